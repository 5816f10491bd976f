#pragma once
#include "stage.hpp"

#include <ise/component/component.hpp>

#include <asio/cancellation_signal.hpp>

namespace seeds {

/// A component of a random deployment: it provides, calls, publishes and subscribes as its plan and its dice say, and
/// tells the models what really happens.
class actor final : public ise::component {
public:
    actor(stage& of, const component_plan& plan, std::string host, std::uint64_t life);
    ~actor() override;

    const component_plan& plan() const noexcept { return plan_; }
    const std::string& host() const noexcept { return host_; }
    std::uint64_t life() const noexcept { return life_; }
    bool serves() const noexcept { return state() == ise::component_state::ready; }
    /// Subscribers that its publication has now; none where it is withdrawn.
    std::size_t subscribers() const { return subscribers_ ? subscribers_() : 0; }

private:
    struct goal {
        std::string name; ///< path or endpoint
        std::string path; ///< as the plan has it
        std::string host;
        bool by_name = true;
        ise::remote way;
        std::vector<std::string> any_of; ///< of a role: the hosts of all who serve it
    };

    ise::task<> run() override;
    ise::task<> fails();

    // actor_calls.cpp
    void provide_calls();
    template <class Services>
    void provide_calls(const Services& services);
    template <class Request, class Response>
    Response answer_now(const Request& asked);
    template <class Request, class Response>
    ise::task<Response> handle(Request asked, const ise::call_context& context);
    ise::task<> calls(std::uint32_t number);
    void make_call(ise::sim::generator& draw, job& what, goal& to, ise::duration& limit);
    template <class Contract>
    ise::task<ise::result<done>> ask(Contract service, ise::remote to, call_terms terms, job what, ise::duration limit);
    template <class Contract>
    void fire(const Contract& service, const ise::remote& to, call_terms terms, job what, ise::duration limit,
              ise::duration patience);
    call_terms terms_of(std::string_view service, const goal& to, const job& what, ise::duration limit) const;
    goal to_component(std::size_t number, bool by_name);
    goal to_role(const std::string& role);

    // actor_subscriptions.cpp
    ise::task<> publishes();
    template <class Contract>
    ise::task<> publishes(Contract service);
    ise::task<> subscribes(const subscriber_plan& terms, std::size_t number);
    template <class Contract>
    ise::task<> subscribes(Contract service, subscriber_plan terms, std::size_t number);

    stage& stage_;
    const component_plan plan_;
    std::string host_;
    std::uint64_t life_;
    census& coroutines_;
    std::uint64_t flows_ = 0;
    bool failing_ = false;
    int failures_ = 0;
    std::function<std::size_t()> subscribers_;
};

} // namespace seeds
