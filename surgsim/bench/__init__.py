"""The project's own speed figures, measured so that what else the machine does cannot change them.

Times are processor time. What is compared is measured in turn, chunk by chunk, in one thread (`chunks`), and
the median of the chunks' ratios counts: whatever slows the machine slows both alike.

`cases` names the runs that are measured; `ticks`, `stages`, `startup`, `memory`, `batch` and
`libraries` measure one thing each; `sections` joins them, and `kept` holds ratios against earlier ones.
"""
