#pragma once
#include <string>

namespace atirma {

/// Makes a random key of the radio for that boat in a new file (mode 0600), and prints its fingerprint. Exit code.
int new_radio_key(const std::string& file, const std::string& boat);
/// Prints boat, epoch and fingerprint of a key file, never the key. Exit code.
int show_radio_key(const std::string& file);

} // namespace atirma
