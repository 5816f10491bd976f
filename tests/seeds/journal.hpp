#pragma once
#include <ise/sim/world.hpp>

#include <fmt/format.h>

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>

namespace seeds {

/// What happened in a run: its newest events to read, a hash over all, and the first invariant that did not hold.
class journal {
public:
    journal(ise::sim::world& world, bool verbose) : world_(world), verbose_(verbose) {}

    template <class... A>
    void note(fmt::format_string<A...> text, A&&... arguments) {
        add(fmt::format(text, std::forward<A>(arguments)...));
    }
    /// An invariant does not hold. The first one counts; the run ends after the present event.
    template <class... A>
    void broken(fmt::format_string<A...> text, A&&... arguments) {
        fail(fmt::format(text, std::forward<A>(arguments)...));
    }

    bool failed() const noexcept { return violation_.has_value(); }
    const std::string& violation() const noexcept { return *violation_; }
    /// Of the events and of everything that the virtual network did.
    std::uint64_t hash() const noexcept { return hash_ ^ world_.trace().hash(); }
    std::uint64_t events() const noexcept { return count_; }
    /// The newest events, one a line.
    std::string newest() const;

    /// How often something was met, for the summary: a generator that never meets it tests nothing of it.
    void tally(const std::string& what, std::uint64_t times = 1) { tallies_[what] += times; }
    const std::map<std::string, std::uint64_t>& tallies() const noexcept { return tallies_; }

private:
    void add(std::string text);
    void fail(std::string text);

    static constexpr std::size_t kept = 60;
    ise::sim::world& world_;
    bool verbose_;
    std::deque<std::string> newest_;
    std::uint64_t hash_ = 0xCBF29CE484222325u;
    std::uint64_t count_ = 0;
    std::optional<std::string> violation_;
    std::map<std::string, std::uint64_t> tallies_;
};

/// Counts coroutines that live.
struct census {
    int alive = 0;
    struct citizen {
        census* of;
        explicit citizen(census& in) : of(&in) { ++of->alive; }
        ~citizen() { --of->alive; }
        citizen(const citizen&) = delete;
        citizen& operator=(const citizen&) = delete;
    };
};

} // namespace seeds
