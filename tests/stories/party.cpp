// One process of a story: a provider, a requester or a subscriber that appends to a log what it does and sees, a line
// by one write(), so that kill -9 loses nothing of it. The lines are those that checker.py reads; a provider with a
// name also writes those that grants.py reads, into a file beside its log.
// usage: story_party provider|requester|subscriber LOG ENDPOINT|PATH [NAME=VALUE]...
#include <ise/ise.hpp>
#include <ise/naming/name_servers.hpp>
#include <ise/service/service_host.hpp>

#include <fmt/format.h>

#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <fcntl.h>
#include <filesystem>
#include <map>
#include <optional>
#include <stdexcept>
#include <string>
#include <thread>
#include <unistd.h>
#include <vector>

namespace story {

using namespace std::chrono_literals;

struct work_request {
    std::string id;
    std::uint32_t takes_ms = 0;  // on a timer
    std::uint32_t blocks_ms = 0; // the provider's thread
    std::vector<std::uint8_t> load;
};
struct work_done {
    std::string id;
};
struct numbered {
    std::uint64_t life = 0; // of the publisher's process
    std::uint64_t number = 0;
    std::vector<std::uint8_t> load;
};

inline constexpr ise::request_response<work_request, work_done> work{"work"};
inline constexpr ise::subscription<numbered> numbers{"numbers"};

// Of CLOCK_MONOTONIC, which all processes of a machine share.
std::int64_t clock_ns() { return std::chrono::steady_clock::now().time_since_epoch().count(); }

class journal {
public:
    explicit journal(const std::string& file)
        : file_(::open(file.c_str(), O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0600)) {
        if (file_ < 0) throw std::runtime_error("cannot open the log " + file);
    }
    template <class... A>
    void operator()(fmt::format_string<A...> form, A&&... arguments) const {
        auto line = fmt::format("{} {}\n", clock_ns(), fmt::format(form, std::forward<A>(arguments)...));
        // A story without a log proves nothing.
        if (::write(file_, line.data(), line.size()) != static_cast<ssize_t>(line.size())) std::abort();
    }

private:
    int file_;
};

// What is done under a granted name, in the lines that grants.py reads.
class grant_journal {
public:
    explicit grant_journal(const std::filesystem::path& log)
        : who_(log.stem()), file_(::open(std::filesystem::path(log).replace_extension(".grants.jsonl").c_str(),
                                         O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0600)) {
        if (file_ < 0) throw std::runtime_error("cannot open the history of grants beside " + log.string());
    }
    void operator()(std::string_view what, const ise::wire::identity& self) const {
        auto line = fmt::format(
            "{{\"at\": {}, \"what\": \"{}\", \"who\": \"{}\", \"path\": \"{}\", \"epoch\": {}, \"holder\": {}}}\n",
            clock_ns(), what, who_, self.path, self.epoch, self.incarnation);
        if (::write(file_, line.data(), line.size()) != static_cast<ssize_t>(line.size())) std::abort();
    }

private:
    std::string who_;
    int file_;
};

struct settings {
    explicit settings(int count, char** words) {
        for (int i = 0; i < count; ++i) {
            std::string word = words[i];
            auto mark = word.find('=');
            if (mark == std::string::npos) throw std::runtime_error("NAME=VALUE, not " + word);
            values[word.substr(0, mark)] = word.substr(mark + 1);
        }
    }
    std::string text(const std::string& name, const std::string& otherwise) const {
        auto found = values.find(name);
        return found == values.end() ? otherwise : found->second;
    }
    std::uint32_t number(const std::string& name, std::uint32_t otherwise) const {
        auto found = values.find(name);
        return found == values.end() ? otherwise : static_cast<std::uint32_t>(std::stoul(found->second));
    }
    /// Whether nothing new is to be begun any more.
    bool hushed() const { return ::access(text("hush", "hush").c_str(), F_OK) == 0; }
    std::map<std::string, std::string> values;
};

// The log keeps to one word a value.
std::string one_word(std::string text) {
    for (auto& letter : text)
        if (letter == ' ' || letter == '\n') letter = '_';
    return text.empty() ? "-" : text;
}

class provider final : public ise::component {
public:
    provider(const journal& log, const grant_journal* grants, const settings& set)
        : log_(log), grants_(grants), set_(set) {}

private:
    ise::task<> run() override {
        life_ = static_cast<std::uint64_t>(clock_ns());
        log_("life {}", life_);
        if (grants_) {
            (*grants_)("began", services().self());
            spawn("acts", act());
        }
        provide(work, [this](work_request rq) -> ise::task<work_done> {
            log_("start {}", rq.id);
            if (rq.blocks_ms > 0) std::this_thread::sleep_for(std::chrono::milliseconds(rq.blocks_ms));
            if (rq.takes_ms > 0) co_await sleep(std::chrono::milliseconds(rq.takes_ms));
            log_("finish {}", rq.id);
            work_done made{rq.id};
            co_return made;
        });
        auto out = publish(numbers);
        const bool waits = set_.text("by", "publish") == "send";
        const auto per_second = set_.number("rate", 200);
        numbered packet;
        packet.life = life_;
        packet.load.resize(set_.number("bytes", 32));
        std::uint64_t due_thousandths = 0;
        while (!set_.hushed()) {
            co_await sleep(10ms);
            for (due_thousandths += per_second * 10; due_thousandths >= 1000; due_thousandths -= 1000) {
                ++packet.number;
                if (waits) {
                    co_await out.send(packet);
                } else {
                    out(packet);
                }
                log_("published {} {}", life_, packet.number);
            }
        }
        log_("silent {}", life_);
    }
    // A component acts under its name as long as it has an epoch.
    ise::task<> act() {
        for (;;) {
            const auto& self = services().self();
            if (self.epoch != 0) (*grants_)("acted", self);
            co_await sleep(100ms);
        }
    }
    void on_name_lost(const ise::failure& why) override {
        if (grants_) (*grants_)("withdrawn", services().self());
        ise::component::on_name_lost(why);
    }

    const journal& log_;
    const grant_journal* grants_;
    const settings& set_;
    std::uint64_t life_ = 0;
};

class requester final : public ise::component {
public:
    requester(const journal& log, const settings& set, const std::string& to) : log_(log), set_(set), to_(to) {}

private:
    ise::task<> run() override {
        auto there = to_.find("://") == std::string::npos ? at(to_) : at(ise::endpoint::parse(to_).value());
        const auto prefix = fmt::format("{}.{}", ::getpid(), clock_ns());
        const auto most = set_.number("calls", 1'000'000'000), pause_ms = set_.number("every_ms", 20);
        for (std::uint32_t n = 1; n <= most && !set_.hushed(); ++n) {
            spawn("call", ask(there, prefix + "." + std::to_string(n)));
            co_await sleep(std::chrono::milliseconds(pause_ms));
        }
        log_("quiet");
    }
    ise::task<> ask(ise::remote there, std::string id) {
        work_request wanted;
        wanted.id = id;
        wanted.takes_ms = set_.number("takes_ms", 0);
        wanted.blocks_ms = set_.number("blocks_ms", 0);
        wanted.load.resize(set_.number("bytes", 32));
        auto limit = std::chrono::milliseconds(set_.number("deadline_ms", 1000));
        log_("call {} {}", id, clock_ns() + std::chrono::nanoseconds(limit).count());
        auto got = co_await there.try_call(work, wanted, limit);
        if (got) {
            log_("done {} ok -", id);
        } else {
            log_("done {} {} {}", id, ise::name_of(got.error().code()), ise::name_of(got.error().executed()));
        }
    }

    const journal& log_;
    const settings& set_;
    std::string to_;
};

class subscriber final : public ise::component {
public:
    subscriber(const journal& log, const settings& set, const std::string& to) : log_(log), set_(set), to_(to) {}

private:
    static ise::subscribe_options policy(const std::string& name, std::uint32_t depth) {
        ise::subscribe_options made;
        if (name == "latest") made = ise::subscribe_options::keep_latest();
        else if (name == "last") made = ise::subscribe_options::keep_last(depth);
        else if (name == "lossless") made = ise::subscribe_options::lossless(depth);
        else if (name == "disconnect") made = ise::subscribe_options::disconnect(depth);
        else throw std::runtime_error("no such policy: " + name);
        made.last_value = false;
        return made;
    }
    ise::task<> run() override {
        auto there = to_.find("://") == std::string::npos ? at(to_) : at(ise::endpoint::parse(to_).value());
        const auto name = set_.text("policy", "last");
        const auto wanted = policy(name, set_.number("depth", 64));
        const auto slow_ms = set_.number("takes_ms", 0);
        for (;;) {
            std::optional<ise::failure> refused;
            ise::subscriber<decltype(numbers)> packets;
            try {
                packets = co_await there.subscribe(numbers, wanted);
            } catch (const ise::error& why) {
                refused = why.why();
            }
            if (refused) {
                log_("refused {} {}", ise::name_of(refused->code()), one_word(refused->message()));
                co_await sleep(200ms);
                continue;
            }
            log_("subscribed {} {}", name, wanted.depth);
            for (;;) {
                auto packet = co_await packets.next();
                if (!packet) break;
                log_("got {} {} {}", packet->life, packet->number, gap(packet.lost_before()));
                if (slow_ms > 0) co_await sleep(std::chrono::milliseconds(slow_ms));
            }
            const auto& counts = packets.counts();
            std::optional<std::uint64_t> lost;
            if (counts.restarts == 0) lost = counts.lost_at_provider + counts.lost_here;
            log_("ended {} {} {}", ise::name_of(packets.cause().code()), gap(lost),
                 one_word(packets.cause().message()));
        }
    }
    static std::string gap(std::optional<std::uint64_t> lost) { return lost ? std::to_string(*lost) : "unknown"; }

    const journal& log_;
    const settings& set_;
    std::string to_;
};

int run(const std::string& role, const std::string& log_file, const std::string& where, const settings& set) {
    journal log(log_file);
    std::optional<grant_journal> grants;
    ise::real_environment env;
    ise::node_options options;
    options.use_names = set.values.contains("names");
    if (options.use_names && role == "provider") grants.emplace(log_file);
    if (options.use_names) options.name_servers = ise::parse_name_servers(set.text("names", "")).value();
    ise::node node(env, std::move(options));
    ise::component_options how;
    std::string says = "ready";
    if (role == "provider") {
        how.listen = {ise::endpoint::parse(where).value()};
        how.registers = set.values.contains("names");
        auto& started = node.start<provider>(set.text("path", "story/provider"), std::move(how), log,
                                             grants ? &*grants : nullptr, set);
        says = started.services().listening().front().text();
    } else {
        how.listens = false;
        how.registers = set.values.contains("names");
        if (role == "requester") node.start<requester>(set.text("path", ""), std::move(how), log, set, where);
        else if (role == "subscriber") node.start<subscriber>("", std::move(how), log, set, where);
        else throw std::runtime_error("no such role: " + role);
    }
    return ise::run_until_signal(node, [&] {
        std::printf("%s\n", says.c_str());
        std::fflush(stdout);
    });
}

} // namespace story

int main(int count, char** words) {
    try {
        if (count < 4)
            throw std::runtime_error(
                "usage: story_party provider|requester|subscriber LOG ENDPOINT|PATH [NAME=VALUE]...");
        story::settings set(count - 4, words + 4);
        return story::run(words[1], words[2], words[3], set);
    } catch (const std::exception& why) {
        std::fprintf(stderr, "story_party: %s\n", why.what());
        return 2;
    }
}
