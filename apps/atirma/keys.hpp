#pragma once
#include <string>

namespace atirma {

/// Makes a random key of the radio for that boat in a new file (mode 0600), a recovery key beside it in FILE.recovery,
/// and prints the fingerprint. Exit code.
int new_radio_key(const std::string& file, const std::string& boat);
/// Prints boat, epoch and fingerprint of a key file, never the key. Exit code.
int show_radio_key(const std::string& file);
/// Makes a new file with the key of `file` and the next one, to which proxies change the boat; sealed by the recovery
/// key in the file `recovery` unless that is empty. Exit code.
int next_radio_key(const std::string& file, const std::string& made, const std::string& recovery);
/// Leaves only the next key in `file`. Exit code.
int finish_radio_key(const std::string& file);

} // namespace atirma
