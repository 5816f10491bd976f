#pragma once
#include "ledger.hpp"
#include "plan.hpp"
#include "taps.hpp"

#include <components/boat/duplicate_filter.hpp>
#include <components/boat/telemetry_follower.hpp>
#include <components/gui_client/operator_port.hpp>

#include <ise/component/component.hpp>

#include <memory>

namespace atirma::stress {

/// A telecommand as its operator saw it.
struct given_command {
    telecommand_request request;
    ise::duration asked{}, decided{-1}; ///< since the beginning
    ise::duration valid_until{};        ///< the same
    telecommand_stage state = telecommand_stage::pending;
    std::optional<ack_code> result;
    std::string text;
    std::uint32_t asks = 0; ///< how often the role was asked, with the same id
};

/// What an operator knows, and takes along when leaving.
struct operator_record {
    std::string name;
    std::size_t index = 0;
    std::vector<order> orders; ///< in the order of time
    std::size_t next_order = 0;
    std::vector<given_command> commands;
    track_cursor seen;
    duplicate_filter shown;              ///< as a console and the page have one
    std::uint64_t authority_changes = 0; ///< that it was told
    bool may_begin = true;               ///< the times of the orders hold
};

/// An operator without a face: follows the telemetry of the communication nodes' role, and gives telecommands by a
/// list, to that role or at his console. What was not decided when he left is asked for again, under the same id, when
/// he is back.
class operator_seat final : public ise::component {
public:
    ~operator_seat() override;
    operator_seat(operator_record& self, ledger& book, stopwatch time, std::shared_ptr<console::operator_port> at)
        : self_(self), book_(book), time_(std::move(time)), console_(std::move(at)) {}

private:
    ise::task<> run() override;
    ise::task<> work();
    ise::task<> follow();
    ise::task<> carry_out(order what);
    ise::task<> give(std::size_t which);
    ise::task<> give_at_console(std::size_t which);
    std::uint32_t id_of(std::size_t which) const;
    ise::duration until(const given_command& one) const;
    ise::task<> take_authority();

    operator_record& self_;
    ledger& book_;
    stopwatch time_;
    std::shared_ptr<console::operator_port> console_;
    bool has_left_ = false;
    bool at_console_ = false; // one telecommand at a time
    ise::remote nodes_;
    std::unique_ptr<telemetry_follower> follower_;
};

} // namespace atirma::stress
