"""The functions and classes of `import hapticlink`; `package_root/__init__.pyi` lists them."""
