"""What is simulated: equations only. No FMI, no files, no clocks."""
