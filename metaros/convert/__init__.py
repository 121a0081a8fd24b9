"""Between numpy and messages, one line each way: images, audio, video packets and point clouds."""

__all__: list[str] = []
