"""The control panel: REST API and web page. It operates the rig through `service.seam`, and never sees a camera."""
