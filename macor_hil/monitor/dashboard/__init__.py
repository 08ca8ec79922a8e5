"""`macor-hil dashboard`: a robot in the browser; needs the extra 'dashboard' (NiceGUI)."""
