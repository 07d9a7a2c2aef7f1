"""The functions and classes of `import hapticlink`; `public/__init__.pyi` lists them."""
