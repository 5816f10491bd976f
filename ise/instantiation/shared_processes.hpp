#pragma once
#include <ise/component/process_services.hpp>
#include <ise/instantiation/instance_names.hpp>

#include <cstdint>
#include <memory>
#include <string>

namespace ise::instantiation {

/// The processes that several instances share: each is started with the first of them, and ends with the last.
class shared_processes {
public:
    shared_processes(server_context& here, instance_table& table, state_keeper& state, supervisor& instances,
                     instance_names& names)
        : here_(here), table_(table), state_(state), instances_(instances), names_(names) {}

    /// Whether an instance of that program can run in that process. Throws errc::invalid_argument.
    void check(const std::string& process, const std::string& program) const;
    /// Starts that life of an instance in its process, and returns when it is ready or not starting any more.
    /// Cancellation: terminal; the instance goes on.
    task<> launch(instance_ptr one, std::uint64_t life);
    /// Ends processes that nobody needs any more.
    void tend();
    /// All that runs in the process of an instance is started again, in one of the program as it is now.
    void replace_that_of(const instance& one);
    /// Goes on with one of an instantiation server before this one.
    void restore(const saved_process& before);
    /// The same, of an instance in a process that was restored. False: it is not there any more.
    bool restore(const instance_ptr& one, const saved_instance& before);
    /// None of them is watched any more.
    void stop();

private:
    endpoint control_of(const std::string& process) const;
    shared_process_ptr open(const instance_ptr& one);
    machine::end_handler end_handler_of(const shared_process_ptr& process);
    void watch(const shared_process_ptr& process);
    std::unique_ptr<process> hold(const shared_process_ptr& where, const std::string& path);
    void stop_in(const shared_process_ptr& where, const std::string& path);
    task<> kill_if_stuck(shared_process_ptr where, std::string path, std::uint64_t life);
    task<> follow(shared_process_ptr where);
    void compare(const shared_process_ptr& where, const process_host::components_response& result);

    server_context& here_;
    instance_table& table_;
    state_keeper& state_;
    supervisor& instances_;
    instance_names& names_;
};

} // namespace ise::instantiation
