"""What a person touches: the command line, the window, the web server."""
