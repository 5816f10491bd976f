// The host of an instantiation server in the virtual world: its programs are virtual processes, its files a map. It
// goes on when the server crashes, at any of its operations if a test wants that.
#pragma once
#include <ise/core/sleep.hpp>
#include <ise/instantiation/machine.hpp>
#include <ise/naming/services.hpp>
#include <ise/sim/world.hpp>

#include <algorithm>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace instantiation_test {

using namespace ise::instantiation;

class virtual_machine final : public machine {
public:
    struct program {
        std::string description;
        std::function<std::shared_ptr<void>(ise::sim::process&, const std::vector<std::string>& words)> run;
        std::string version = "1";        ///< another after it was built again
        ise::duration lasts_after_term{}; ///< how long it takes to end
        ise::duration describes_after{};  ///< how long it takes to describe itself
        bool deaf = false;
    };

    virtual_machine(ise::sim::world& of, std::string host_name) : world(of), host(std::move(host_name)) {}

    ise::sim::world& world;
    std::string host;
    std::map<std::string, program> installed; ///< by the name of its file
    std::map<std::string, std::string> files;
    bool reads = true;                                             ///< false: the disk fails when a file is read
    std::vector<std::pair<ise::time_point, std::string>> launches; ///< when, and of which path
    /// Called before each operation that changes something; false: the server is dead, and this does not happen any
    /// more.
    std::function<bool()> may = [] { return true; };

    struct entry {
        ise::sim::process* who = nullptr;
        process_stamp stamp;
        std::string mark, path;
        const program* of = nullptr;
        process_end end{true, true, 9}; ///< how it will have ended
        std::function<void(process_end)> watcher;
        bool running = true;
    };
    std::vector<std::shared_ptr<entry>> processes;

    std::vector<std::shared_ptr<entry>> running() const {
        auto left = processes;
        std::erase_if(left, [](const auto& one) { return !one->running; });
        return left;
    }
    /// The one process at a path.
    entry& at(const std::string& path) {
        for (const auto& one : running())
            if (one->path == path) return *one;
        throw std::logic_error("nothing runs at " + path);
    }
    void end(entry& which, process_end how) {
        which.end = how;
        which.who->crash();
    }

    // machine
    ise::result<std::unique_ptr<process>> launch(ise::loop& on, const launch_order& what, end_handler ended) override {
        if (!may()) return ise::failure(ise::errc::io_failed, "dead");
        auto found = installed.find(what.program.substr(what.program.rfind('/') + 1));
        if (found == installed.end())
            return ise::failure(ise::errc::io_failed, "cannot start " + what.program + ": No such file or directory");
        auto made = std::make_shared<entry>();
        made->mark = what.mark;
        made->of = &found->second;
        for (const auto& word : what.words)
            if (word.starts_with("--path=")) made->path = word.substr(7);
        launches.emplace_back(world.now(), made->path);
        std::map<std::string, std::string> variables(what.variables.begin(), what.variables.end());
        variables[ise::naming::launch_mark_variable] = what.mark;
        made->who = &world.host(host).start_process(
            "component",
            [made, words = what.words](ise::sim::process& env) {
                env.keep(std::shared_ptr<void>(nullptr, [made](void*) { // when it ends, however that comes
                    made->running = false;
                    if (made->watcher) std::exchange(made->watcher, nullptr)(made->end);
                }));
                return made->of->run(env, words);
            },
            variables);
        made->stamp = {static_cast<std::int32_t>(made->who->identity().process_id),
                       static_cast<std::uint64_t>(processes.size() + 1)};
        processes.push_back(made);
        return watch(on, made, std::move(ended));
    }
    ise::result<std::unique_ptr<process>> adopt(ise::loop& on, process_stamp who, const std::string& mark,
                                                end_handler ended) override {
        for (const auto& one : running())
            if (one->mark == mark && (who.pid == 0 || one->stamp == who)) return watch(on, one, std::move(ended));
        return ise::failure(ise::errc::no_such_name, "gone");
    }
    bool carries(std::int32_t pid, const std::string& mark) const override {
        return std::ranges::any_of(processes,
                                   [&](const auto& one) { return one->stamp.pid == pid && one->mark == mark; });
    }
    bool alive(std::int32_t pid) const override {
        return std::ranges::any_of(processes, [&](const auto& one) { return one->stamp.pid == pid && one->running; });
    }
    std::string boot() const override { return "first"; }
    ise::result<std::vector<program_file>> programs(const std::string&) const override {
        std::vector<program_file> all;
        for (const auto& [name, what] : installed) all.push_back({name, what.version, {}});
        return all;
    }
    std::string version_of(const std::string& file) const override {
        auto found = installed.find(file.substr(file.rfind('/') + 1));
        return found == installed.end() ? std::string() : found->second.version;
    }
    ise::task<ise::result<std::string>> ask(ise::loop& on, std::string name, std::size_t,
                                            ise::duration limit) override {
        auto asked = installed.at(name.substr(name.rfind('/') + 1));
        co_await ise::sleep_for(on, std::min(limit, asked.describes_after));
        if (asked.describes_after > limit)
            co_return ise::failure(ise::errc::timed_out, name + " --describe: it did not end in time");
        ise::result<std::string> outcome(std::move(asked.description));
        co_return outcome;
    }
    ise::result<std::string> read_file(const std::string& path, std::size_t max_bytes) const override {
        if (!reads) return ise::failure(ise::errc::io_failed, "cannot read " + path);
        auto found = files.find(path);
        if (found == files.end()) return ise::failure(ise::errc::no_such_name, "no such file");
        if (found->second.size() > max_bytes) return ise::failure(ise::errc::too_large, path + " is too large");
        return found->second;
    }
    ise::result<void> replace_file(const std::string& path, const std::string& content) override {
        if (!may()) return ise::failure(ise::errc::io_failed, "dead");
        files[path] = content;
        return {};
    }
    ise::result<void> replace_reserved(const std::string& path, const std::string& content) override {
        return replace_file(path, content);
    }
    ise::result<void> rename(const std::string& from, const std::string& to) override {
        if (!may()) return ise::failure(ise::errc::io_failed, "dead");
        auto moved = files.extract(from);
        if (moved.empty()) return ise::failure(ise::errc::io_failed, "no such file");
        files[to] = std::move(moved.mapped());
        return {};
    }
    std::uint64_t size_of(const std::string& path) const override {
        auto found = files.find(path);
        return found == files.end() ? 0 : found->second.size();
    }
    std::string read_part(const std::string& path, std::uint64_t offset, std::size_t most) const override {
        auto found = files.find(path);
        return found == files.end() || offset >= found->second.size() ? std::string()
                                                                      : found->second.substr(offset, most);
    }
    void remove(const std::string& path) override { files.erase(path); }

private:
    class handle final : public process {
    public:
        handle(ise::sim::world& of, std::shared_ptr<entry> which) : world_(of), which_(std::move(which)) {}
        ~handle() override { which_->watcher = nullptr; }
        const process_stamp& stamp() const noexcept override { return which_->stamp; }
        void terminate() override {
            if (which_->of->deaf) return;
            world_.after(which_->of->lasts_after_term, [which = which_] {
                if (!which->running) return;
                which->end = {true, false, 0};
                which->who->stop();
            });
        }
        void kill() override {
            world_.after({}, [which = which_] {
                if (which->running) which->who->crash();
            });
        }

    private:
        ise::sim::world& world_;
        std::shared_ptr<entry> which_;
    };

    std::unique_ptr<process> watch(ise::loop& on, const std::shared_ptr<entry>& which, end_handler ended) {
        which->watcher = [gate = on.gate(), which, ended = std::move(ended)](process_end how) {
            gate->post([ended, how] { ended(how); });
        };
        return std::make_unique<handle>(world, which);
    }
};

} // namespace instantiation_test
