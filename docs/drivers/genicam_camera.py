"""Any GenICam camera (GigE Vision, USB3 Vision, CoaXPress) through harvesters and its maker's GenTL producer.

``pip install harvesters``; then, in a bench file::

    camera: {driver: genicam_camera.py:GenicamCamera, producer: /opt/maker/lib/producer.cti, pixel_format: Mono12}
"""

from pathlib import Path
from typing import Literal

import numpy as np
from harvesters.core import Harvester

# What a camera does of itself, by the names that GenICam gives to it; each camera has some of them.
HELPERS = {"ExposureAuto": "Off", "GainAuto": "Off", "BalanceWhiteAuto": "Off", "GammaEnable": False}
PATIENCE = 10.0  # seconds beyond an exposure


class GenicamCamera:
    """A camera with one plane.

    producer: path of the maker's GenTL producer (.cti); serial: of the camera, where it finds several.
    """

    def __init__(
        self,
        producer: str,
        serial: str = "",
        pixel_format: Literal["Mono8", "Mono10", "Mono12", "Mono14", "Mono16"] = "Mono12",
    ) -> None:
        if not Path(producer).is_file():
            raise FileNotFoundError(f"{producer}: no such file; expected a GenTL producer (.cti)")
        self._harvester = Harvester()
        self._harvester.add_file(producer)
        self._harvester.update()
        there = self._harvester.device_info_list
        fitting = [index for index, device in enumerate(there) if serial in ("", device.serial_number)]
        if len(fitting) != 1:
            found = ", ".join(f"{device.model} {device.serial_number}" for device in there)
            raise ValueError(f"{len(fitting)} cameras {serial!r}; found: {found or 'none'}")
        self.name = f"{there[fitting[0]].model} {there[fitting[0]].serial_number}"
        self._camera = self._harvester.create(fitting[0])
        self._nodes = self._camera.remote_device.node_map
        self._nodes.PixelFormat.value = pixel_format
        for name, value in HELPERS.items():
            if (node := getattr(self._nodes, name, None)) is not None:
                node.value = value
        self.white = 2 ** int(pixel_format.removeprefix("Mono")) - 1
        exposure = self._nodes.ExposureTime  # in microseconds
        self.exposures = (exposure.min / 1e6, exposure.max / 1e6)

    def expose(self, seconds: float) -> tuple[np.ndarray, float]:
        """A frame ``(H, W)`` and the exposure [s] that the camera set. Acquisition begins anew: no frame is older."""
        self._nodes.ExposureTime.value = seconds * 1e6
        real = self._nodes.ExposureTime.value / 1e6
        self._camera.start()
        try:
            with self._camera.fetch(timeout=real + PATIENCE) as buffer:
                image = buffer.payload.components[0]
                return image.data.reshape(image.height, image.width).copy(), real
        finally:
            self._camera.stop()

    def close(self) -> None:
        """Give the camera back."""
        self._camera.destroy()
        self._harvester.reset()
