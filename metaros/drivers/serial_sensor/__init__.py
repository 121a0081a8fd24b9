"""Any sensor that writes lines of text on a serial port."""
