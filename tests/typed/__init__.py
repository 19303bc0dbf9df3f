"""Every command that a page, or a file of `config`, tells somebody to type."""
