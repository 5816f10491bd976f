// The table of all commands.
#include "../command.hpp"

namespace ise::cli {

// Each is defined in its file, which no other needs to know.
extern const command list_command, describe_command, call_command, echo_command, hz_command, start_command,
    stop_command, restart_command, kill_command, logs_command, ps_command, up_command, down_command, diff_command,
    validate_command, param_command, doctor_command, graph_command, top_command, ping_command, bench_command,
    bw_command, delay_command, tree_command, services_command, types_command, type_command, completion_command,
    version_command, pub_command, mock_command, run_command, access_command, keys_command, record_command, bag_command,
    play_command, trace_command;

std::span<const command* const> all_commands() {
    static constexpr const command* all[] = {
        &list_command,     &describe_command, &call_command,     &echo_command,       &hz_command,      &start_command,
        &stop_command,     &restart_command,  &kill_command,     &logs_command,       &ps_command,      &up_command,
        &down_command,     &diff_command,     &validate_command, &param_command,      &doctor_command,  &graph_command,
        &top_command,      &ping_command,     &bench_command,    &bw_command,         &delay_command,   &tree_command,
        &services_command, &types_command,    &type_command,     &completion_command, &version_command, &pub_command,
        &mock_command,     &run_command,      &access_command,   &keys_command,       &record_command,  &bag_command,
        &play_command,     &trace_command};
    return all;
}

} // namespace ise::cli
