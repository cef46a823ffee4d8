"""No more model than a frame needs: the method `auto` and `jflnr.select`."""
