#pragma once
#include <ise/access/audit.hpp>
#include <ise/access/policy.hpp>
#include <ise/core/environment.hpp>
#include <ise/core/result.hpp>
#include <ise/core/time.hpp>

#include <atomic>
#include <cstdint>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <string_view>

namespace ise::access {

/// In the message of each session that is not made because of an unusable policy, also where it comes from a peer.
inline constexpr std::string_view unusable_policy = "the access policy cannot be used";

/// The access policy of a node while it runs: reads its file again when that has changed, and keeps the audit log.
/// Thread-safe.
class guard {
public:
    /// How often the file is looked at; an edit counts this much later at most.
    static constexpr duration reread_after = std::chrono::seconds(5);

    /// Errors, with the file: errc::unauthorized (other users can change it), errc::io_failed, errc::invalid_argument
    /// with each problem and its line.
    static result<std::shared_ptr<guard>> load(environment& env, const std::string& file, audit_log audit);

    /// Looks at the file if that was long enough ago. From then on `version()` is another one if it has changed.
    void refresh();
    /// Counts up with each change of what `current()` or `broken()` say.
    std::uint64_t version() const noexcept { return version_.load(std::memory_order_acquire); }
    /// The last policy that could be used.
    std::shared_ptr<const policy> current() const;
    /// Why the file cannot be used now: sessions go on by the last policy, and no new ones are made.
    std::optional<failure> broken() const;
    /// When the present policy was read.
    wall_time read_at() const;

    /// What the policy has against a request, as a failure for the one who asked; both refusals and what was allowed
    /// go into the audit log if `keep`. `by` null, or of the same process: nothing. `component`: where it is asked.
    std::optional<failure> objection(const verified_peer* by, const request& what, std::string_view component,
                                     bool keep = true);
    /// The same by a view that was made before, and without a line for what is allowed.
    std::optional<failure> objection(const view& by, const verified_peer& peer, const request& what,
                                     std::string_view component, bool keep);
    /// A use that was allowed, for the audit log.
    void note(const verified_peer& by, const request& what, std::string_view component, const verdict& why);

    audit_log& audit() noexcept { return audit_; }

private:
    guard(environment& env, std::string file, audit_log audit);
    result<void> read();

    environment& env_;
    const std::string file_;
    audit_log audit_;
    mutable std::mutex mutex_;
    std::shared_ptr<const policy> now_;
    std::string seen_; // the content of the file
    std::optional<failure> broken_;
    wall_time read_at_{};
    time_point looked_at_{};
    std::atomic<std::uint64_t> version_{1};
};

/// "ise://atirma/web may not call 'telecommand' of atirma/communication: no rule of access.toml allows it (ise access
/// why …)": errc::access_denied, not executed.
failure denial(std::string_view identity, const request& what, const verdict& why, const policy& by);

} // namespace ise::access
