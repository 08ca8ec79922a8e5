"""Client of an e-puck or e-puck2: it is driven by speed and step counters."""
