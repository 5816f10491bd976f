#pragma once
#include <components/communication_node/services.hpp>
#include <components/postgres/postgres.hpp>

#include <span>
#include <string>

namespace atirma {

/// Puts many packets of one boat into a database at once, by COPY where none of them is there already. Blocks. Errors
/// of all: io_failed; nothing of that call is kept then.
class postgres_backfill {
public:
    /// Throws ise::error: io_failed. `in` outlives it.
    postgres_backfill(postgres_session& in, const std::string& boat);

    ise::result<std::uint64_t> add(std::span<const telemetry_packet> packets); ///< how many were new
    ise::result<void> put(std::span<const command_record> records);
    /// False if the state there is as new.
    ise::result<bool> put(const authority_state& state, std::uint64_t change);

private:
    std::uint64_t add_locked(std::span<const telemetry_packet> packets);

    postgres_session& session_;
    std::string boat_; // its number
};

} // namespace atirma
