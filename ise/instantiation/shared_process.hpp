#pragma once
#include <ise/instantiation/instance.hpp>
#include <ise/service/remote.hpp>

#include <functional>
#include <map>
#include <memory>
#include <string>

namespace ise::instantiation {

/// A process in which several instances run, each on a thread of its own (ise/component/process_services.hpp), as long
/// as it runs. On the server's loop.
struct shared_process {
    /// An instance that runs in it.
    struct member {
        std::weak_ptr<instance> who;
        std::uint64_t life = 0;   ///< of the instance
        std::uint64_t number = 0; ///< of this life in the process; 0: of before this server, whichever runs there
        bool confirmed = false;   ///< its start was answered
    };

    std::string name, program;
    std::string version; ///< of the program, when it was started (machine::version_of)
    std::string mark;
    std::shared_ptr<output_file> output;
    endpoint control; ///< a socket in the server's own folder: nobody else reaches it
    remote host;
    std::unique_ptr<process> running;
    std::map<std::string, member> members; ///< by path
    bool outdated = false; ///< its program was rebuilt: who runs in it leaves, and comes back in another
    bool ending = false;   ///< nobody needs it any more
    bool over = false;
};

/// What such an instance holds in place of a process of its own. Destroying it calls nobody any more.
class shared_component final : public process {
public:
    shared_component(process_stamp who, std::function<void()> stop, std::function<void()> kill)
        : who_(who), stop_(std::move(stop)), kill_(std::move(kill)) {}

    const process_stamp& stamp() const noexcept override { return who_; }
    void terminate() override { stop_(); }
    void kill() override { kill_(); }

private:
    process_stamp who_;
    std::function<void()> stop_, kill_;
};

} // namespace ise::instantiation
