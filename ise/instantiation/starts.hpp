#pragma once
#include <ise/instantiation/installed_types.hpp>
#include <ise/instantiation/shared_processes.hpp>

#include <deque>
#include <string>

namespace ise::instantiation {

/// Starts, restarts and ends instances on request, within the limits of the server.
class starts {
public:
    starts(server_context& here, installed_types& types, instance_table& table, supervisor& instances,
           instance_names& names, shared_processes& shared)
        : here_(here), types_(types), table_(table), instances_(instances), names_(names), shared_(shared) {}

    /// Returns when it is ready, or why it is not. Cancellation: terminal; what was being started is ended.
    /// errc::access_denied: the access policy does not let `by`, who lives as long as it runs.
    task<start_response> start(start_request request, const verified_peer* by);
    /// The same with an instance that is known; errc::refused: there is none. Cancellation: terminal; the restart goes
    /// on.
    task<start_response> restart(std::string path);
    /// Returns when it has ended. errc::refused: there is no such instance. Cancellation: terminal; it ends all the
    /// same.
    task<ended_response> end(stop_request how, bool at_once);
    /// Waits for what becomes of an instance that is starting. Cancellation: terminal; it goes on.
    task<start_response> until_ready(instance_ptr one);
    /// Ends an instance that is starting, and that nobody waits for any more.
    void give_up(const instance_ptr& one);
    /// Counts a start. Throws errc::overloaded where there were too many.
    void check_rate();
    /// What is answered in place of an instance. Where too many were started, with the time until there is room.
    start_response refused(const error& why) const;

private:
    task<start_response> begin(start_request request, const verified_peer* by);
    task<start_response> begin_again(instance_ptr one);
    void check_room(const std::string& path);

    server_context& here_;
    installed_types& types_;
    instance_table& table_;
    supervisor& instances_;
    instance_names& names_;
    shared_processes& shared_;
    std::deque<time_point> recent_; // within the window
};

} // namespace ise::instantiation
