"""What is taken from runs, batches and studies into papers, talks and other tools."""
