"""The control panel: REST API and web page. It talks to the service through `rig_service`, never to a camera."""
