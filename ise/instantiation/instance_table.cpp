#include <ise/instantiation/instance_table.hpp>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <utility>
#include <vector>

namespace ise::instantiation {

instance_ptr instance_table::find(const std::string& path) const {
    auto found = instances_.find(path);
    return found == instances_.end() ? nullptr : found->second;
}

instance_ptr instance_table::at(const std::string& path) const {
    if (auto found = find(path)) return found;
    std::vector<std::string> known;
    for (const auto& [name, one] : instances_) known.push_back(name);
    throw error(errc::refused, fmt::format("no instance '{}' was started here; there {}", path.substr(0, 200),
                                           known.empty() ? "are none" : fmt::format("are {}", fmt::join(known, ", "))));
}

bool instance_table::goes_on(const instance_ptr& one, std::uint64_t stops) const {
    return find(one->plan.path) == one && one->watch.stops() == stops;
}

instance_ptr instance_table::add(start_request request, launch_plan plan) {
    auto path = plan.path;
    auto output = output_of(path, request.process);
    auto made = std::make_shared<instance>(here_.self.env(), std::move(request), std::move(plan), std::move(output));
    made->since = here_.self.wall();
    instances_[path] = made;
    return made;
}

void instance_table::remove(const std::string& path) {
    auto found = instances_.find(path);
    if (prints_alone(*found->second)) found->second->output->remove();
    instances_.erase(found);
}

shared_process_ptr instance_table::process_of(const instance& one) const {
    auto found = processes_.find(one.asked.process);
    return found == processes_.end() ? nullptr : found->second;
}

void instance_table::add(const shared_process_ptr& process) { processes_[process->name] = process; }

void instance_table::remove(const shared_process_ptr& process) {
    auto found = processes_.find(process->name);
    if (found != processes_.end() && found->second == process) processes_.erase(found);
}

std::shared_ptr<output_file> instance_table::output_of(const std::string& path, const std::string& process) const {
    std::string name = process.empty() ? "" : "+process+" + process; // no path has a plus
    if (process.empty())
        for (char letter : path) name += letter == '/' ? '+' : letter;
    for (const auto& [other, one] : instances_)
        if (!process.empty() && one->asked.process == process) return one->output;
    return std::make_shared<output_file>(here_.host, here_.options.state_folder + "/" + name + ".log",
                                         here_.options.max_output_bytes);
}

bool instance_table::prints_alone(const instance& one) const {
    return one.asked.process.empty() || (!process_of(one) && std::ranges::none_of(instances_, [&](const auto& other) {
               return other.second.get() != &one && other.second->output == one.output;
           }));
}

instance_info instance_table::info_of(const instance& one) const {
    auto made = one.text();
    if (!one.running || one.version.empty() || one.plan.program.empty()) return made;
    auto now = here_.host.version_of(here_.options.programs_folder + "/" + one.plan.program);
    made.rebuilt = !now.empty() && now != one.version;
    return made;
}

} // namespace ise::instantiation
