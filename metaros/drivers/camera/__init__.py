"""The camera driver: OpenCV sources to JPEG images, H.264 video and CameraInfo."""
