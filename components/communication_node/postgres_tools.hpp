#pragma once
#include <components/boat/services.hpp>
#include <components/communication_node/store_check.hpp>

#include <ise/core/result.hpp>

#include <cstdint>
#include <optional>
#include <span>
#include <string>

// For `atirma store`: each call blocks, and returns what it did in words. Errors of all: io_failed, with the database
// or the file and its message; invalid_argument for a wrong URL, or a database of a newer program.
namespace atirma {

/// Makes the tables, or brings them to this program's version; each step is a transaction. Nodes may run meanwhile.
ise::result<std::string> migrate_database(const std::string& url);

/// Copies the sound rows of a file to the boat's rows; packets and telecommands that are there already stay the same.
ise::result<std::string> import_store(const std::string& file, const std::string& url, const std::string& boat);
/// The boat's rows go to a file, which is made if it is not there, in the order of the store.
ise::result<std::string> export_store(const std::string& url, const std::string& boat, const std::string& file);

/// Reads every row, and looks at the settings that durability depends on.
ise::result<store_verdict> check_database(const std::string& url);

/// Sets how long packets are kept. No boat: all boats; no kind: all kinds; no days: the rule is removed. Returns all
/// rules.
ise::result<std::string> set_retention(const std::string& url, const std::string& boat, std::optional<int> kind,
                                       std::optional<std::uint32_t> days);
ise::result<std::string> retention(const std::string& url); ///< all rules

} // namespace atirma
