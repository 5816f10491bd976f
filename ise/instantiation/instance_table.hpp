#pragma once
#include <ise/instantiation/server_context.hpp>
#include <ise/instantiation/shared_process.hpp>

#include <map>
#include <memory>
#include <string>

namespace ise::instantiation {

using instance_ptr = std::shared_ptr<instance>;
using shared_process_ptr = std::shared_ptr<shared_process>;

/// The instances that an instantiation server remembers, and the processes that several of them share. It decides
/// nothing.
class instance_table {
public:
    explicit instance_table(server_context& here) : here_(here) {}

    const std::map<std::string, instance_ptr>& instances() const noexcept { return instances_; }       ///< by path
    const std::map<std::string, shared_process_ptr>& processes() const noexcept { return processes_; } ///< by name

    /// Null: there is none.
    instance_ptr find(const std::string& path) const;
    /// Throws errc::refused with what there is.
    instance_ptr at(const std::string& path) const;
    /// Whether it has not been forgotten, and nobody has stopped it since `supervision::stops()` was that.
    bool goes_on(const instance_ptr& one, std::uint64_t stops) const;
    instance_ptr add(start_request request, launch_plan plan);
    /// With its output, unless others have it too.
    void remove(const std::string& path);

    /// The process that it shares, if that runs.
    shared_process_ptr process_of(const instance& one) const;
    void add(const shared_process_ptr& process);
    /// Unless another has its name meanwhile.
    void remove(const shared_process_ptr& process);

    /// Where an instance prints: with the others of its process, if it shares one.
    std::shared_ptr<output_file> output_of(const std::string& path, const std::string& process) const;
    bool prints_alone(const instance& one) const;
    /// With what only this host knows.
    instance_info info_of(const instance& one) const;

private:
    server_context& here_;
    std::map<std::string, instance_ptr> instances_;
    std::map<std::string, shared_process_ptr> processes_;
};

} // namespace ise::instantiation
