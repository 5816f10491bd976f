#pragma once
#include <apps/stress/packet_key.hpp>
#include <components/boat/services.hpp>

#include <ise/core/result.hpp>

#include <array>
#include <cstdint>
#include <set>
#include <string>
#include <vector>

namespace atirma::stress {

/// The stores of the two communication nodes: a file each, or one database of both. Each call reads anew.
class shore_stores {
public:
    /// The files, the primary's first, or the URL of the database.
    explicit shore_stores(std::vector<std::string> where) : where_(std::move(where)) {}
    bool in_database() const noexcept { return where_.size() == 1; }

    /// Of each node. Errors: of a database that is away.
    ise::result<std::array<std::set<packet_key>, 2>> keys() const;
    /// Of the primary, in the order of the boat's measurements. Throws ise::error.
    std::vector<telemetry_packet> packets() const;
    /// Ids of the telecommands on record at the primary. Throws ise::error.
    std::set<std::uint32_t> commands() const;

private:
    std::vector<std::string> where_;
};

} // namespace atirma::stress
