"""The pages as a browser reads them: HTML, styles and scripts, and how they become one file."""
