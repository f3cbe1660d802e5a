"""Arms from other people's files: read, checked, and put into the form that the package's own arms have."""
