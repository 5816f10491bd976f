#pragma once
#include <ise/bag/recording.hpp>
#include <ise/component/component.hpp>
#include <ise/core/endpoint.hpp>
#include <ise/session/contract.hpp>
#include <ise/subscription/subscriber_core.hpp>

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace ise::bag {

/// What is recorded.
struct recorder_options {
    std::vector<std::string> paths;    ///< components, each with those below it; none: all
    std::vector<std::string> services; ///< only these; none: all
    std::vector<std::string> except;   ///< services that are left out
    bool calls = true;                 ///< of components that show them (ISE_RECORD_CALLS)
    bool parameters = true;
    bool own_services = false; ///< ISE's own, such as the name server's
    overflow policy = overflow::keep_last;
    std::uint32_t depth = 1024;         ///< packets in each subscription's queues
    std::vector<endpoint> name_servers; ///< default: ISE_NAME_SERVER, else that of this machine

    recording_options files;
    duration flush = std::chrono::seconds(1);        ///< what is older is in the file
    std::size_t queue_bytes = std::size_t{64} << 20; ///< that wait for the disk; beyond, packets are counted as lost
    duration ring{};                                 ///< keeps only so much, in memory, until a trigger; 0: none
    duration after = std::chrono::seconds(10);       ///< recorded after a trigger
    std::size_t ring_bytes = std::size_t{256} << 20; ///< of the ring; the oldest go
    std::vector<std::string> triggers;               ///< COMPONENT/SERVICE: a packet of it; gone:PATH: a name that goes
};

/// Counts of a recorder.
struct recorder_counts {
    std::uint64_t messages = 0; ///< written
    std::uint64_t bytes = 0;    ///< of the files
    std::uint64_t topics = 0;   ///< services that were recorded
    std::uint64_t lost = 0;     ///< packets that were not recorded: the disk was too slow, or no file can have them
    std::uint64_t gaps = 0;     ///< in what came
    std::uint64_t triggered = 0;
    std::vector<std::string> files;
};

/// Records a running system, on the loop of `self`; the disk is waited for on other threads. Every packet that does not
/// come into a file is counted in it, as an event on `ise/gaps`.
class recorder_core {
public:
    /// `self` must outlive it.
    recorder_core(component& self, recorder_options options);
    ~recorder_core();
    recorder_core(const recorder_core&) = delete;
    recorder_core& operator=(const recorder_core&) = delete;

    /// Records until `finish` was called or a file cannot be written (throws errc::io_failed and the like). The last
    /// file is closed then. Cancellation: terminal; while the loop waits, what has come is written and the file closed.
    task<> run();
    /// Ends the recording: `run` writes what has come, and returns. On the loop.
    void finish();
    /// Writes the ring; its file has the reason as metadata `ise.trigger`. False: there is no ring.
    bool trigger(const std::string& reason);
    const recorder_counts& counts() const noexcept; ///< so far

private:
    struct state;
    std::shared_ptr<state> state_;
};

/// The request of `trigger_service`.
struct trigger_request {
    std::string reason;
};
/// Its response.
struct trigger_response {
    std::uint64_t triggered = 0; ///< recordings so far
};
/// Asks for the counts of a recorder.
struct recorder_status_request {};
/// Writes the ring of a recorder; errc::refused where it has none.
inline constexpr request_response<trigger_request, trigger_response> trigger_service{"trigger"};
/// The counts of a recorder.
inline constexpr request_response<recorder_status_request, recorder_counts> recorder_status_service{"status"};

/// A recorder as a component, for deployments.
class recorder final : public component {
public:
    explicit recorder(recorder_options options) : options_(std::move(options)) {}
    task<> run() override;

private:
    recorder_options options_;
};

} // namespace ise::bag
