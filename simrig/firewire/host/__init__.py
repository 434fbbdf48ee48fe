"""The computer's side of the emulated bus: `/dev/fw*` as libdc1394 sees it, and the shim that brings it there."""
