"""Target images, one source a file: photographs, charts, generated training images, a folder of one's own.

A dataset is a frozen dataclass of parameters with ``items()``, ``load(item, shape, channels)`` and ``digest(item)``
(see ``base.Dataset``). Whatever its source, a target is linear light in [0, 1], float32, of exactly the shape that is
asked for, and never stretched.
"""
