"""The command line. Modules here import heavy packages only once a command is chosen."""
