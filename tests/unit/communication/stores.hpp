// Packets, telecommands and stores for the tests of a node's store.
#pragma once
#include <components/communication_node/sqlite_store.hpp>

#include <support/catch.hpp>

#include <algorithm>
#include <filesystem>
#include <unistd.h>

namespace store_test {

using namespace atirma;
using namespace std::chrono_literals;

struct folder {
    std::filesystem::path path =
        std::filesystem::temp_directory_path() / ("ise-node-store-" + std::to_string(::getpid()));
    folder() { std::filesystem::create_directories(path); }
    ~folder() { std::filesystem::remove_all(path); }
    std::string file() const { return (path / "node.db").string(); }
    std::string backup() const { return (path / "backup.db").string(); }
    /// Puts the backup in the place of the file, which nobody has open.
    void restore() const {
        for (const auto* part : {"", "-wal", "-shm"}) std::filesystem::remove(file() + part);
        std::filesystem::copy_file(backup(), file());
    }
};

inline sqlite_store opened(const std::string& file, std::uint64_t number) {
    auto made = sqlite_store::open(file, number);
    REQUIRE(made);
    return std::move(*made);
}

inline const utc_time morning{std::chrono::hours(400'000)};

inline telemetry_packet packet(std::uint32_t sequence, link_id link = link_id::xbee) {
    telemetry_packet made;
    made.link = link;
    made.boot = 3;
    made.sequence = sequence;
    made.measured_at = morning + sequence * 1s;
    made.received_at = made.measured_at + 1s;
    made.raw = {std::byte{1}, std::byte{1}, std::byte{static_cast<unsigned char>(sequence)}};
    return made;
}

inline std::vector<telemetry_packet> packets(std::uint32_t first, std::uint32_t last) {
    std::vector<telemetry_packet> made;
    for (auto i = first; i <= last; ++i) made.push_back(packet(i));
    return made;
}

inline std::vector<std::uint32_t> sequences(const std::vector<telemetry_packet>& of) {
    std::vector<std::uint32_t> made;
    for (const auto& one : of) made.push_back(one.sequence);
    return made;
}

inline command_record record(std::uint32_t id, telecommand_stage stage = telecommand_stage::queued,
                             std::string who = "ana") {
    command_record made;
    made.status.id = id;
    made.status.kind = command_kind::set_mode;
    made.status.command = commands::set_mode{sailing_mode::hold};
    made.status.state = stage;
    made.status.asked_by = std::move(who);
    made.status.at = morning;
    made.valid_until = morning + 300s;
    made.via = link_id::gprs;
    made.node = "shore/one";
    return made;
}

// One round of replication.
inline std::uint32_t pull(sqlite_store& into, sqlite_store& from, std::size_t most = 1000) {
    auto shared = from.shared(into.known_of_peer());
    auto page = from.page_after(into.number(), shared.packets, shared.commands, most).value();
    return into.apply(page, page.commands, false).value();
}

using numbers = std::vector<std::uint32_t>;

} // namespace store_test
