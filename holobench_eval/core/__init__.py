"""What everything else stands on: errors, seeds, files, hashes, checked YAML, plug-ins, the device."""
