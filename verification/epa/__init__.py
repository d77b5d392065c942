"""The rules on EPA's cycles beside EPA's dynamometer figures."""
