"""The shaders' sources, `.vert` and `.frag` beside this file."""
