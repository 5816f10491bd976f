#include <components/mqtt_bridge/mqtt_bridge.hpp>

#include <chrono>
#include <utility>

namespace ise::mqtt {

component_type bridge_type(std::string name, std::string path, bridge_options defaults,
                           std::function<void(const std::string&)> announce) {
    component_type type(std::move(name), "connects the system to an MQTT broker", std::move(path));
    struct bound {
        bridge_options options;
        std::string protocol = "5", encoding = "json";
        double deadline_s = 0, remember_h = 0, store_mb = 0;
    };
    auto held = std::make_shared<bound>();
    auto& options = held->options;
    options = std::move(defaults);
    held->protocol = options.broker.version_5 ? "5" : "3.1.1";
    held->encoding = options.protobuf ? "protobuf" : "json";
    held->deadline_s = std::chrono::duration<double>(options.call_deadline).count();
    held->remember_h = std::chrono::duration<double, std::ratio<3600>>(options.remember).count();
    held->store_mb = static_cast<double>(options.queue.disk_bytes >> 20);
    options.on_connected = [announce = std::move(announce), reported = false](const std::string& url) mutable {
        if (!std::exchange(reported, true)) announce("ready: " + url);
    };
    auto& set = type.parameters;
    set.add("broker", options.broker.url, "the broker; mqtt: 1883, mqtts with TLS: 8883").kind(parameter_kind::url);
    set.add("protocol", held->protocol, "version of MQTT").one_of({"5", "3.1.1"});
    set.add("client-id", options.broker.client_id, "at the broker; empty: made of host and path");
    set.add("user", options.broker.user, "at the broker; empty: none");
    set.add("password-file", options.broker.password_file, "file with its password, which only this user can read")
        .kind(parameter_kind::path);
    set.add("ca-file", options.broker.ca_file, "PEM file of authorities that sign brokers; empty: those of the system")
        .kind(parameter_kind::path);
    set.add("certificate", options.broker.certificate_file, "PEM file of the own certificate; empty: none")
        .kind(parameter_kind::path);
    set.add("key-file", options.broker.key_file, "PEM file of its key").kind(parameter_kind::path);
    set.add("prefix", options.prefix, "beginning of all topics; one for each system at a broker");
    set.add("encoding", held->encoding, "of packets").one_of({"json", "protobuf"});
    options.add_to(set);
    set.add("retain", options.retain, "the broker keeps the last message of each service for new subscribers");
    set.add("queue", options.queued,
            "services of which every packet counts: while the broker is away they wait; of others the latest counts");
    set.add("store", options.store, "file for what waits, and for calls; empty: in memory only")
        .kind(parameter_kind::path);
    set.add("store-mb", held->store_mb, "most that waits in the store; beyond it the oldest packets are dropped")
        .range(1, 1'000'000)
        .unit("MiB");
    set.add("allow-calls", options.allow_calls, "MQTT clients may call services (MQTT 5)");
    set.add("call-seconds", held->deadline_s, "deadline of calls").range(0.1, 3600).unit("s");
    set.add("remember-hours", held->remember_h, "how long a request is remembered, so that it is not executed again")
        .range(0.1, 8760)
        .unit("h");
    set.add("publish", options.publish, "subscription services of the bridge that MQTT clients may publish to");
    type.provides(status_service);
    type.make = [held] {
        auto made = held->options;
        made.broker.version_5 = held->protocol == "5";
        made.protobuf = held->encoding == "protobuf";
        made.call_deadline = std::chrono::duration_cast<duration>(std::chrono::duration<double>(held->deadline_s));
        made.remember =
            std::chrono::duration_cast<duration>(std::chrono::duration<double, std::ratio<3600>>(held->remember_h));
        made.queue.disk_bytes = static_cast<std::uint64_t>(held->store_mb * (1 << 20));
        return std::make_unique<mqtt_bridge>(std::move(made));
    };
    return type;
}

} // namespace ise::mqtt
