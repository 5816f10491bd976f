#pragma once
#include <ise/core/result.hpp>
#include <ise/core/time.hpp>

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
#include <string_view>

namespace ise::access {

/// A line of the audit log.
struct audit_entry {
    wall_time at{};
    std::string who, serial, from; ///< as in `verified_peer`
    std::string component;         ///< where it was asked
    std::string what;              ///< "call atirma/communication:telecommand"
    bool allowed = false;
    std::string rule; ///< "access.toml:12"; empty: no rule allows it
};

/// `{"at":"2026-11-25T22:10:06.123Z","who":…,"serial":…,"from":…,"component":…,"what":…,"verdict":"denied","rule":…,
/// "left_out":0}`, without the end of the line.
std::string json_of(const audit_entry& entry, std::uint64_t left_out);

/// The audit log of a node: a line of JSON for each entry. Refusals are bounded for each identity, since a peer may ask
/// as often as it likes, and must not hide what others are refused: at most `most_refusals` in a second. Of those left
/// out the last is written in a later second, or when the log closes; `left_out` counts the ones of the same identity
/// before the line. A value, shared by its copies. Thread-safe.
class audit_log {
public:
    static constexpr unsigned most_refusals = 20;
    /// Identities that are told apart within a second; those beyond share one account.
    static constexpr std::size_t most_identities = 256;
    using sink = std::function<void(const std::string& line)>;

    /// Keeps nothing.
    audit_log() = default;
    explicit audit_log(sink to);
    /// Appends to a file of mode 0600, which several processes may share. Each line is one write; one that fails is
    /// told to `complain` once. errc::io_failed.
    static result<audit_log> open(const std::string& file, std::function<void(const std::string&)> complain);

    void keep(const audit_entry& entry) const;
    bool keeps() const noexcept { return state_ != nullptr; }

private:
    struct state;
    std::shared_ptr<state> state_;
};

} // namespace ise::access
