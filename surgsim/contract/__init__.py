"""What every part promises, as checks that run on shipped parts and on those of other packages."""
