#pragma once
#include <ise/core/result.hpp>
#include <ise/core/waiter.hpp>
#include <ise/naming/registrar.hpp>
#include <ise/naming/services.hpp>

#include <cstdint>
#include <optional>
#include <string>
#include <utility>

namespace ise {

/// A name that a node has or wants, and what the name server's answers mean for it.
struct held_name {
    held_name(loop& on, registration of) : who(std::move(of)), answered(on) {}

    /// Whether the server is to be told, from `not_before` on.
    bool to_tell() const noexcept { return registered != version && !refused; }
    naming::component_claim claim() const;

    /// Takes the answer of that server. A failure: the name is not ours, and will not be (name_taken, superseded,
    /// refused). Else it is granted (`epoch`), or it is asked for again from `not_before` on.
    ///
    /// A name that another holds is given up only once that one has renewed its lease twice at one server: one renewal
    /// may still have been on its way when its sender died, and the lease of the dead ends soon.
    result<void> take(const naming::grant& answer, time_point now, duration lease, std::uint64_t server);

    /// Where it stands among those to tell: since when, and behind how many of the same time.
    using place = std::pair<time_point, std::uint64_t>;

    registration who;
    std::optional<place> waits_at; ///< while the server is to be told
    std::uint64_t epoch = 0;       ///< 0: never granted
    std::uint64_t proof = 0;       ///< of the epoch, as the server gave it
    std::uint64_t shown = 0;       ///< the epoch that the node was told of last
    std::uint64_t version = 1;     ///< of what the server is to be told…
    std::uint64_t registered = 0;  ///< …of what the server knows…
    std::uint64_t sent = 0;        ///< …and of the request that is not answered yet
    time_point not_before = time_point::min();
    std::optional<naming::holder> other; ///< who was found to hold it first…
    std::uint64_t other_at = 0;          ///< …at that server (its incarnation)
    std::string obstacle;                ///< why it was not granted yet
    std::optional<failure> refused;      ///< the answer, until who waits for it has it
    waiter<> answered;
};

} // namespace ise
