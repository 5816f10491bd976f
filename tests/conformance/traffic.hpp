#pragma once
#include "pair.hpp"

#include <map>
#include <optional>
#include <set>

/// What the two say to each other.
namespace conformance {

using namespace boat_services;
using namespace std::chrono_literals;
using ise::errc;
using ise::execution;

using fixes = publication<ise::subscription<fix>>;
using call = std::shared_ptr<started<ise::result<mode_set>>>;

ise::task<ise::result<mode_set>> try_helm(ise::remote boat, std::string mode, ise::duration limit);
ise::task<ise::result<blob>> try_echo(ise::remote boat, std::size_t size,
                                      ise::duration limit = std::chrono::seconds(60));
/// Begins a call of the requester.
call begin_helm(pair& at, std::string mode, ise::duration limit);

/// A packet that bears its number: the n-th that is published has n, unless a test says otherwise.
inline fix numbered(double number) { return fix{number, 0, 0}; }

/// What a subscriber got.
struct reading {
    std::vector<double> packets;
    std::vector<std::optional<std::uint64_t>> gaps; ///< lost before each
    std::optional<subscriber<ise::subscription<fix>>> stream;
    bool subscribed = false;

    bool any() const { return !packets.empty(); }
    double last() const { return packets.empty() ? 0 : packets.back(); }
    std::uint64_t lost() const;
    const ise::subscription_counts& counts() const { return stream->counts(); }
    /// Every packet once, in order, and each gap is as long as it was told to be.
    void check_exact() const;
};
/// Subscribes and reads on, to the end of the subscription.
std::shared_ptr<reading> follow(side& by, const ise::remote& from, ise::subscribe_options options);
/// Subscribes, and takes nothing; completes when the provider has committed.
std::shared_ptr<reading> sit(pair& at, ise::subscribe_options options);
/// Takes what is there.
void drain(reading& from);

/// Publishes numbered packets from 1 on, one every `pause`, until it is stopped.
class ticker {
public:
    ticker(side& by, fixes to, ise::duration pause);
    void stop() { *stopped_ = true; }

private:
    std::shared_ptr<bool> stopped_ = std::make_shared<bool>(false);
};

/// Calls and a subscription over a relay (where there is one), struck by one fault after the other: each call runs at
/// most once, packets come in order, once, and what is lost is counted to the packet; the subscription resumes.
void sail(pair& at, const std::vector<fault>& script);

} // namespace conformance
