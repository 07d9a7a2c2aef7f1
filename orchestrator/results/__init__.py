"""Result folders: files, tables, figures, summary."""
