"""From a protocol and a library to stimuli: points, films, cameras, rendering."""
