// `ise doctor` and `ise top` on systems of real processes, each of which ails in its own way.
#include <support/catch.hpp>
#include <support/program.hpp>

#include <nlohmann/json.hpp>

#include <csignal>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <list>
#include <optional>
#include <string>
#include <vector>

#include <unistd.h>

using ise_test::Contains;
using ise_test::program;
using nlohmann::json;

namespace {

/// A name server and its patients. Whatever is asked is asked until it is answered as the story goes: a test that waits
/// for what does not come is ended from outside.
struct ward {
    /// Each of its patients holds its name by a lease of so many seconds.
    explicit ward(int lease_s)
        : names({"ise_name_server", "--listen", "tcp://127.0.0.1:0", "--lease", std::to_string(lease_s) + "s",
                 "--fresh"}),
          lease(std::to_string(lease_s)) {
        auto line = names.read_line();
        REQUIRE_THAT(line, Contains("listens on tcp://"));
        at = line.substr(line.find("tcp://"));
    }

    program& admit(const std::string& ailment) {
        auto& one = patients.emplace_back(std::vector<std::string>{"doctor_patient", at, lease, ailment});
        REQUIRE(one.read_line() == "ready");
        return one;
    }
    std::vector<std::string> ise(std::vector<std::string> words, const std::string& timeout) const {
        words.insert(words.begin(), {"ise", "--name-server", at, "--timeout", timeout});
        return words;
    }
    json doctor(const std::string& timeout = "120s") const {
        return json::parse(ise_test::run_program(ise({"doctor", "--json", "--interval", "200ms"}, timeout)).out);
    }
    static std::optional<json> find(const json& output, const std::string& kind, const std::string& component) {
        for (const auto& one : output["findings"])
            if (one["kind"] == kind && one["component"] == component) return one;
        return std::nullopt;
    }
    /// A finding with what to do about it, and the doctor's exit code says that there is one.
    json diagnose(const std::string& kind, const std::string& component, const std::string& timeout = "120s") const {
        for (;;) {
            auto ran = ise_test::run_program(ise({"doctor", "--json", "--interval", "200ms"}, timeout));
            auto parsed = json::parse(ran.out);
            auto found = find(parsed, kind, component);
            if (!found) continue;
            CHECK(ran.exit_code == 1);
            CHECK_FALSE(parsed["healthy"].get<bool>());
            CHECK_FALSE((*found)["advice"].get<std::string>().empty());
            return *found;
        }
    }

    program names;
    std::string lease, at;
    std::list<program> patients;
};

std::string message(const json& finding) { return finding["message"]; }
std::string advice(const json& finding) { return finding["advice"]; }

json service_of(const json& table, const std::string& path, const std::string& name) {
    for (const auto& component : table["components"])
        if (component["path"] == path)
            for (const auto& one : component["services"])
                if (one["name"] == name) return one;
    return json();
}

} // namespace

TEST_CASE("doctor on real processes: a name server that was killed") {
    ward in(2);
    in.admit("gives");
    in.names.signal(SIGKILL);
    in.names.wait();
    auto found = in.diagnose("no_name_server", "");
    CHECK_THAT(message(found), Contains("there is no name server at " + in.at));
    CHECK_THAT(advice(found), Contains("ise_name_server"));
}

TEST_CASE(
    "doctor on real processes: a stopped component does not answer, then its lease is stale, until its name goes") {
    ward in(20);
    auto& patient = in.admit("gives");
    patient.signal(SIGSTOP);
    CHECK_THAT(message(in.diagnose("no_answer", "ward/gives", "2s")), Contains("did not answer"));
    for (;;) {
        auto result = in.doctor("2s");
        if (auto found = ward::find(result, "stale_lease", "ward/gives")) {
            CHECK_THAT(message(*found), Contains("its lease of 20 s was not renewed for"));
            CHECK_THAT(advice(*found), Contains("is process "));
            break;
        }
        if (result["components"] != 0) continue; // not yet
        // On a busy machine its name may go between two looks: once more.
        patient.signal(SIGCONT);
        while (in.doctor("2s")["components"] == 0) {}
        patient.signal(SIGSTOP);
    }
    patient.signal(SIGCONT);
    while (!in.doctor()["healthy"].get<bool>()) {}
}

TEST_CASE("doctor on real processes: a killed component, whose name is there yet, is not reached") {
    ward in(600);
    auto& patient = in.admit("gives");
    patient.signal(SIGKILL);
    patient.wait();
    auto found = in.diagnose("unreachable", "ward/gives");
    CHECK_THAT(message(found), Contains("ward/gives"));
    CHECK_THAT(advice(found), Contains("its name expires with its lease"));
}

TEST_CASE("doctor on real processes: a component that advertises where nobody listens is not reached") {
    ward in(2);
    in.admit("nowhere");
    auto result = in.doctor("10s");
    auto found = ward::find(result, "unreachable", "ward/nowhere");
    if (!found)
        found = ward::find(result, "no_answer", "ward/nowhere"); // a network that swallows what it cannot deliver
    INFO(result);
    REQUIRE(found);
    CHECK_THAT(message(*found), Contains("192.0.2.1:7411"));
}

TEST_CASE("doctor on real processes: two that were built from different headers") {
    ward in(2);
    in.admit("asks");
    CHECK_THAT(message(in.diagnose("no_provider", "ward/asks")), Contains("no component provides 'steer'"));
    in.admit("gives");
    auto found = in.diagnose("schema_mismatch", "ward/asks");
    CHECK_THAT(message(found), Contains("'steer' of ward/gives") && Contains("heading_deg"));
    CHECK_THAT(advice(found), Contains("ise type diff ward/asks steer ward/gives"));
}

TEST_CASE("doctor, list and describe on real processes: a requester waits for its provider, and says so until that is "
          "there") {
    ward in(2);
    in.admit("seeks");
    auto found = in.diagnose("waits", "ward/seeks");
    CHECK_THAT(message(found), Contains("it waits for ward/gives since 20") && Contains("no component is registered"));
    CHECK_THAT(advice(found), Contains("start the component"));
    auto listed = json::parse(ise_test::run_program(in.ise({"list", "--json"}, "120s")).out);
    CHECK(listed[0]["waits_for"] == "ward/gives");
    CHECK(listed[0]["state"] == "ready");
    CHECK_THAT(ise_test::run_program(in.ise({"list"}, "120s")).out, Contains("ready, waits for ward/gives"));
    auto described = json::parse(ise_test::run_program(in.ise({"describe", "ward/seeks", "--json"}, "120s")).out);
    CHECK(described["waits"][0]["target"] == "ward/gives");
    CHECK(described["waits"][0]["stage"] == "name");
    CHECK(described["waits"][0]["waited_s"] > 3);
    CHECK_THAT(ise_test::run_program(in.ise({"describe", "ward/seeks"}, "120s")).out,
               Contains("waits\n  it waits for ward/gives since 20"));
    in.admit("gives");
    while (!in.doctor()["healthy"].get<bool>()) {}
    json graph;
    do graph = json::parse(ise_test::run_program(in.ise({"graph", "--json"}, "120s")).out);
    while (graph["connections"].empty() || graph["connections"][0]["services"].empty()); // its call is on its way
    auto services = graph["connections"][0]["services"];
    REQUIRE(services.size() == 1);
    CHECK(services[0]["service"] == "steer");
    CHECK(services[0]["provider"] == "ward/gives");
    CHECK_THAT(ise_test::run_program(in.ise({"services"}, "120s")).out, Contains("steer") && Contains("ward/seeks"));
    listed = json::parse(ise_test::run_program(in.ise({"list", "--json"}, "120s")).out);
    for (const auto& one : listed) CHECK(one["waits_for"].is_null());
}

TEST_CASE("doctor on real processes: a clock that was set wrong") {
    ward in(2);
    in.admit("early");
    auto found = in.diagnose("clock_skew", "ward/early");
    CHECK_THAT(message(found), Contains(" ahead of this machine's"));
    CHECK_THAT(advice(found), Contains("NTP"));
}

TEST_CASE(
    "doctor and top on real processes: a subscriber that does not read costs packets, counted with their reason") {
    ward in(2);
    in.admit("floods");
    program reader(in.ise({"echo", "ward/floods", "chunks", "--depth", "2"}, "120s"));
    REQUIRE_THAT(reader.read_line(), Contains("number"));
    reader.signal(SIGSTOP);
    auto found = in.diagnose("drops_packets", "ward/floods");
    CHECK_THAT(message(found), Contains("of 'chunks' (overrun)"));
    for (;;) { // while its session lasts
        auto table =
            json::parse(ise_test::run_program(in.ise({"top", "--once", "--json", "--every", "200ms"}, "120s")).out);
        auto one = service_of(table, "ward/floods", "chunks");
        if (one.is_null()) continue; // it was seen once only
        CHECK(one["not_sent"]["overrun"]["ever"] > 0);
        CHECK(one["hz"] > 0);
        break;
    }
    reader.signal(SIGCONT);
}

TEST_CASE("doctor and top on real processes: a service that is asked for more than it can do") {
    ward in(2);
    in.admit("slow");
    program crowd(in.ise({"bench", "ward/slow", "nap", "{}", "--concurrent", "32", "--for", "24h"}, "120s"));
    auto found = in.diagnose("overloaded", "ward/slow");
    CHECK_THAT(message(found), Contains("beyond its limits") && Contains("of 'nap' (overloaded)"));
    CHECK_THAT(advice(found), Contains("serve_options"));
    for (;;) {
        auto table =
            json::parse(ise_test::run_program(in.ise({"top", "--once", "--json", "--every", "2s"}, "120s")).out);
        auto one = service_of(table, "ward/slow", "nap");
        if (one.is_null() || one["handled_p50_s"].is_null() || one["waited_p99_s"].is_null() ||
            one["waited_p99_s"] < 0.02)
            continue;
        CHECK(one["handled_p50_s"] >= 0.02); // it naps for at least as long
        CHECK(one["refused"]["overloaded"]["ever"] > 0);
        break;
    }
    crowd.signal(SIGINT);
}

TEST_CASE("doctor on real processes: calls that wait for one another in a circle are named with their lines") {
    ward in(30);
    in.admit("left");
    in.admit("right");
    auto found = in.diagnose("call_cycle", "ward/left");
    CHECK_THAT(message(found), Contains("the handler of 'left' at ward/left, ") && Contains("patient.cpp:") &&
                                   Contains("waits for 'right' of ward/right"));
    CHECK_THAT(message(found), Contains("the handler of 'right' at ward/right, ") &&
                                   Contains("waits for 'left' of ward/left") &&
                                   Contains("where all handlers are busy"));
}

TEST_CASE("trace on real processes: a call is followed from the command line through two components") {
    auto file = std::filesystem::temp_directory_path() / ("ise_trace_" + std::to_string(::getpid()) + ".jsonl");
    ::setenv("ISE_TRACES", file.c_str(), 1);
    ward in(30);
    in.admit("slow");
    in.admit("passes");
    auto called = ise_test::run_program(in.ise({"call", "ward/passes", "pass", R"({"milliseconds":1})"}, "120s"));
    CHECK(called.exit_code == 0);
    ::unsetenv("ISE_TRACES");
    // Spans are written every second; a trace has six, with the look for a name, when all sides have written theirs.
    std::string id;
    for (std::size_t sides = 0; sides < 6;) {
        sides = 0;
        std::ifstream lines(file);
        std::string trace;
        std::vector<json> spans;
        for (std::string line; std::getline(lines, line);) {
            auto request = json::parse(line, nullptr, false);
            if (request.is_discarded()) continue; // is being written
            for (const auto& resource : request["resourceSpans"])
                for (const auto& one : resource["scopeSpans"][0]["spans"]) {
                    if (one["name"] == "nap") id = one["traceId"];
                    spans.push_back(one);
                }
        }
        for (const auto& one : spans) sides += one["traceId"] == id;
    }
    auto drawn = ise_test::run_program(in.ise({"trace", file.string(), "--id", id}, "120s"));
    CHECK(drawn.exit_code == 0);
    INFO(drawn.out);
    CHECK_THAT(drawn.out, Contains("trace " + id) && Contains("6 spans"));
    const auto pass = drawn.out.find("pass"), through = drawn.out.find("ward/passes"), nap = drawn.out.find("nap"),
               end = drawn.out.find("ward/slow");
    CHECK(pass < nap);
    CHECK(through != std::string::npos);
    CHECK(end != std::string::npos);
    auto unknown = ise_test::run_program(in.ise({"trace", file.string(), "--id", "0123456789abcdef0"}, "120s"));
    CHECK(unknown.exit_code == 1);
    CHECK_THAT(unknown.err, Contains("no trace begins with '0123456789abcdef0'"));
    std::filesystem::remove(file);
}
