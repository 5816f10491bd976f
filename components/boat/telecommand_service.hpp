#pragma once
#include <components/boat/command_book.hpp>

#include <ise/component/component.hpp>

#include <functional>
#include <list>
#include <map>

namespace atirma {

/// The telecommand side of a proxy, whichever its link is: provides `telecommand` and `telecommand_state` over a book,
/// answers those who wait, tells those who follow. Its component outlives it and gives what is due to the link.
///
///     desk.give = [this] { while (auto due = desk.book().next_due(…)) …; return true; };
///     desk.provide();
///     desk.book().on_outcome(…);  desk.book().on_acknowledgement(…);         // as the link fares,
///     desk.work();                                                           // then this
class telecommand_service {
public:
    telecommand_service(ise::component& of, book_options options);

    /// Gives what is due to the link; called by `work()`, never within itself. False, and nothing was given, while the
    /// link is down: who sees it come up calls `book().on_link_up()` and `work()`.
    std::function<bool()> give;

    /// Provides the two services.
    void provide();
    /// Gives what is due, tells what changed, and looks when to come again.
    void work();

    command_book& book() noexcept { return book_; }
    /// Civil time as the book counts it.
    utc_time clock() const;

private:
    struct waiting_call;

    ise::task<telecommand_reply> command(telecommand_request request, ise::time_point deadline);

    ise::component& of_;
    command_book book_;
    ise::timer due_;
    std::list<waiting_call*> calls_;
    std::map<std::uint64_t, std::uint32_t> followers_; // subscriber's number → id, 0 for all
    ise::publication<std::decay_t<decltype(services::telecommand_state)>> states_;
    bool working_ = false;
};

} // namespace atirma
