#pragma once
#include <ise/component/component.hpp>
#include <ise/component/process_services.hpp>
#include <ise/instantiation/shared_process.hpp>
#include <ise/naming/services.hpp>
#include <ise/transport/security.hpp>

#include <deque>
#include <map>
#include <memory>
#include <set>
#include <string>

namespace ise::instantiation {

struct server_options {
    std::string programs_folder;                                ///< what can be started lies here
    std::string state_folder;                                   ///< of this server alone; it exists
    endpoint name_server = default_name_server();               ///< told to what it starts
    std::vector<std::pair<std::string, std::string>> variables; ///< of what it starts: PATH, HOME and the like
    launch_rules rules;
    std::size_t max_instances = 64; ///< those that have ended count until their place is needed
    std::size_t max_starts = 30;    ///< within `starts_window`, of all kinds
    duration starts_window = std::chrono::seconds(10);
    std::uint64_t max_output_bytes = 256 << 10; ///< of each of the two output files of an instance
    duration describe_within = std::chrono::seconds(5);
    duration look_every = std::chrono::milliseconds(200); ///< at the output
};

/// The path of a host's instantiation server: "ise/host/shore"; what cannot be in a path becomes a dash.
std::string path_of_host(std::string_view host_name);

/// Whether an instantiation server with these credentials may listen there, since whoever reaches it can start
/// programs: errc::unauthorized beyond this host, but with a shared key or on tls.
result<void> may_listen(const endpoint& at, const security& credentials);

/// The instantiation server of a host (ise/instantiation/services.hpp): starts components of the types that the
/// programs of a folder have, watches over them, and goes on with them when it was killed and is started again.
///
/// `host` outlives it. Stopping it leaves alone what it started: the program around it ends that, or leaves it for
/// the next instantiation server.
class instantiation_server final : public component {
public:
    instantiation_server(machine& host, server_options options);
    ~instantiation_server() override;

private:
    using instance_ptr = std::shared_ptr<instance>;

    task<> run() override;
    void offer_services();
    void offer_watching();

    // instantiation_server_catalogue.cpp
    task<> read_catalogue();
    task<types_response> tell_types();
    task<launch_plan> plan(start_request request);

    // instantiation_server_check.cpp
    task<checks_response> check_all(checks_request request);
    task<checked_start> check_one(start_request request, std::vector<endpoint>& wanted);
    bool compare_environment(const instance_ptr& one, const start_request& wanted);

    // instantiation_server_change.cpp
    task<change_response> change_one(change_request what);
    task<change_response> change_to(start_request to, bool only_in_place);
    task<set_response> set(set_request what);
    task<result<void>> set_parameters(instance_ptr one, std::vector<argument> settings);
    void become(const instance_ptr& one, start_request asked, launch_plan plan);
    void forget(const std::string& path);

    // instantiation_server_start.cpp
    task<start_response> start_one(start_request request);
    task<start_response> begin(start_request request);
    task<start_response> begin_again(instance_ptr one);
    task<start_response> restart_one(std::string path);
    task<start_response> until_ready(instance_ptr one);
    task<> launch(instance_ptr one, std::uint64_t life);
    task<> free_name(instance_ptr one, std::uint64_t life);
    task<> follow_readiness(instance_ptr one, std::uint64_t life);
    task<std::string> obstacle_of(instance_ptr one);
    task<> check_name(std::string path);
    void check_endpoints(const std::vector<endpoint>& wanted);
    void check_room(const std::string& path);
    void check_rate();

    // instantiation_server_probe.cpp
    void begin_probing(const instance_ptr& one);
    task<> follow_probe(instance_ptr one, std::uint64_t life);

    // instantiation_server_shared.cpp
    endpoint control_of(const std::string& process) const;
    void check_process(const std::string& process, const std::string& program);
    std::shared_ptr<shared_process> process_of(const instance& one) const;
    std::shared_ptr<shared_process> open_process(const instance_ptr& one);
    machine::end_handler process_end_handler(const std::shared_ptr<shared_process>& of);
    void watch_process(const std::shared_ptr<shared_process>& what);
    task<> launch_in_process(instance_ptr one, std::uint64_t life);
    std::unique_ptr<process> hold_component(const std::shared_ptr<shared_process>& where, const std::string& path);
    void stop_in_process(const std::shared_ptr<shared_process>& where, const std::string& path);
    task<> kill_if_stuck(std::shared_ptr<shared_process> where, std::string path, std::uint64_t life);
    task<> follow_process(std::shared_ptr<shared_process> where);
    void take_in(shared_process& of, const process_host::components_response& told);
    void tend_processes();
    void replace_process_of(const instance& one);
    void restore(const saved_process& before);
    bool restore_in_process(const instance_ptr& one, const saved_instance& before);

    task<ended_response> end_one(stop_request how, bool at_once);
    void restore(const saved_state& before);
    void restore(const saved_instance& before, bool same_boot);
    bool adopt(const instance_ptr& one, const saved_instance& before, bool same_boot);
    process_end how_it_ended(process_end told, const std::string& mark, const output_file& printed) const;
    launch_order order_for(const std::string& program, const output_file& printed) const;

    /// With what only this host knows.
    instance_info text_of(const instance& one) const;
    instance_ptr find(const std::string& path) const;
    instance_ptr remember(start_request request, launch_plan plan);
    std::shared_ptr<output_file> output_of(const std::string& path, const std::string& process) const;
    bool prints_alone(const instance& one) const;
    /// Does what was decided, and tells whoever wants to know.
    void carry_out(const instance_ptr& one, supervision::act what);
    void on_end(const instance_ptr& one, std::uint64_t life, process_end how);
    machine::end_handler end_handler_of(const instance_ptr& one, const std::string& mark, std::uint64_t life);
    void free_names_of(const std::string& mark);
    task<> tell_end(std::string mark);
    void changed(const instance_ptr& one);
    /// The state goes to the disk; what cannot be written is logged, too.
    result<void> try_save();
    void save() { [[maybe_unused]] auto logged = try_save(); }
    void look_at_output();
    std::string state_file() const { return options_.state_folder + "/state.json"; }

    machine& host_;
    server_options options_;
    remote names_;
    std::unique_ptr<catalogue> catalogue_;
    time_point catalogue_read_ = time_point::min();
    std::vector<program_file> programs_; // that the catalogue was read from
    bool reading_catalogue_ = false;
    bool stopping_ = false;                         // what is started goes on
    std::map<std::string, instance_ptr> instances_; // by path
    std::multiset<std::string> freeing_;            // marks of ended processes, until the name server knows
    std::map<std::string, std::shared_ptr<shared_process>> processes_;   // that several of them share, by name
    std::map<std::string, std::pair<instance_state, std::string>> told_; // what of each was told last
    std::deque<time_point> starts_;
    std::set<std::string> changing_;                 // paths
    std::map<std::uint64_t, std::string> followers_; // of output, by number: their path
    publication<std::remove_const_t<decltype(services::output)>> output_;
    publication<std::remove_const_t<decltype(services::events)>> events_;
    std::unique_ptr<timer> look_;
};

} // namespace ise::instantiation
