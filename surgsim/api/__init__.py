"""The Python interface: what `import surgsim` offers, each name in a file of its own."""
