"""Pictures of pages that have many: a browser loads each when it is about to be seen."""

from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.transforms import SphinxTransform


class Lazy(SphinxTransform):
    """Marks the pictures of the pages that `lazy_pages` names."""

    default_priority = 400

    def apply(self, **_: Any) -> None:
        """Change the pictures of one page."""
        if self.env.docname in self.config.lazy_pages:
            for node in self.document.findall(nodes.image):
                node["loading"] = "lazy"


def setup(app: Sphinx) -> dict[str, Any]:
    """Add the transform."""
    app.add_config_value("lazy_pages", [], "env")
    app.add_transform(Lazy)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
