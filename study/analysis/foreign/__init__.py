"""Tables that other programs wrote: what their columns are."""
