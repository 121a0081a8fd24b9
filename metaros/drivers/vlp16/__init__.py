"""Velodyne VLP-16 (Puck): sixteen lasers over UDP."""
