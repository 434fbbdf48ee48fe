"""The commands of `svev`: options, help texts and output; `svev.cli` lists them."""
