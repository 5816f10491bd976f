#pragma once
#include <components/boat/notifier.hpp>
#include <components/boat/services.hpp>

#include <ise/component/component.hpp>

#include <functional>
#include <list>
#include <map>

namespace atirma {

/// Who waits for telecommands at a component: subscribers of `telecommand_state` and callers of `telecommand`. Its
/// component outlives it.
class telecommand_audience {
public:
    explicit telecommand_audience(ise::component& of) : of_(of), decided_(of.on()) {}

    /// Provides `telecommand_state`. `now` tells where the telecommand of that id stands, if it is known; with 0 all
    /// that are not decided.
    void provide(std::function<std::vector<telecommand_status>(std::uint32_t id)> now);
    /// A change, to all whom it concerns.
    void tell(const telecommand_status& change);
    /// Waits until the telecommand is decided, or `pending` has to leave to reach the caller before the deadline (30 s
    /// where there is none). `last` is where it stands.
    ise::task<telecommand_reply> reply(telecommand_status last, ise::time_point deadline);

private:
    struct waiting_call;

    ise::component& of_;
    notifier decided_;
    std::list<waiting_call*> calls_;
    std::map<std::uint64_t, std::uint32_t> followers_; // subscriber's number → id, 0 for all
    ise::publication<std::decay_t<decltype(services::telecommand_state)>> states_;
};

} // namespace atirma
