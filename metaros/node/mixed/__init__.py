"""Mixed fleets: endpoints speak on a second key, too, while there are peers whose distribution writes other hashes."""
