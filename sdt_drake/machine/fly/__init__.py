"""From a recorded flight to a motion of a device: read `flight`, `alignment`, `program`, `option`,
`procedure`."""
