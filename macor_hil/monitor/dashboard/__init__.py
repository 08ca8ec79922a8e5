"""`macor-hil dashboard`: robots in the browser; needs the extra 'dashboard' (Starlette)."""
