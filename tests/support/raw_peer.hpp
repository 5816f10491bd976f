#pragma once
#include <ise/net/connect.hpp>
#include <ise/packet/codec.hpp>
#include <ise/transport/datagram_stream.hpp>
#include <ise/wire/frame.hpp>
#include <ise/wire/messages.hpp>
#include <ise/wire/parser.hpp>

#include <asio/buffer.hpp>

#include <support/sim_parties.hpp>

#include <cstring>

namespace ise_test {

/// A peer of the virtual world that says what it likes: bytes and frames as a script tells it. Over udp they lie in a
/// channel in good order; packets that come beside its stream are among what it got.
class raw_peer {
public:
    struct came {
        ise::wire::frame_header header;
        ise::bytes body;
    };

    /// Connects; the world runs until it has. With `reads` false it never takes a byte of what it is sent; over udp it
    /// says what has arrived all the same, as its system would over tcp.
    raw_peer(sim_parties& all, ise::sim::process& from, const std::string& to, bool reads = true)
        : all_(all), host_(from.make_loop("raw")) {
        auto& on = host_->loop();
        auto connecting = start(
            on, ise::net::connect_until(on, ise::endpoint::parse(to).value(), on.now() + std::chrono::seconds(10)));
        if (!all_.run_until([&] { return connecting->done; })) throw std::logic_error("no connection");
        line_ = std::move(connecting->get().value());
        begin(reads);
    }
    /// At the other end: takes over a connection that was accepted on this loop.
    raw_peer(sim_parties& all, std::unique_ptr<ise::loop_host> host, std::unique_ptr<ise::stream> accepted)
        : all_(all), host_(std::move(host)), line_(std::move(accepted)) {
        begin(true);
    }
    ~raw_peer() {
        line_->close();
        all_.run_until([&] { return !reading_ || reading_->done; });
    }
    raw_peer(const raw_peer&) = delete;
    raw_peer& operator=(const raw_peer&) = delete;

    void say(ise::bytes_view raw) { unsent_.insert(unsent_.end(), raw.begin(), raw.end()), push(); }
    void say(ise::wire::frame_type type, std::uint64_t id, ise::bytes_view body, std::uint8_t flags = 0) {
        ise::buffer out;
        ise::wire::put_frame(out, type, flags, id, [&](ise::buffer& to) { to.append(body); });
        say(out.view());
    }
    template <class Packet>
    void say(ise::wire::frame_type type, std::uint64_t id, const Packet& packet) {
        auto body = ise::encode(packet);
        say(type, id, ise::bytes_view(body));
    }
    /// A session in good order, up to the welcome.
    void greet(const std::string& path = "raw", ise::wire::limits accepts = {}) {
        ise::wire::hello hello;
        hello.self.path = path;
        hello.self.incarnation = 1;
        hello.accepts = accepts;
        greet(hello);
    }
    void greet(const ise::wire::hello& hello) {
        say(ise::wire::frame_type::hello, 0, hello);
        all_.world.run_for(std::chrono::milliseconds(200));
    }
    void introduce(std::uint64_t number, const std::string& service, const std::vector<std::uint64_t>& fingerprints) {
        ise::wire::introduction result;
        result.service = service;
        result.fingerprints = fingerprints;
        say(ise::wire::frame_type::introduce, number, result);
    }
    template <class Packet>
    void request(std::uint64_t id, std::uint32_t number, std::chrono::nanoseconds time, const Packet& packet) {
        ise::buffer body;
        body.append(number);
        body.append(static_cast<std::int64_t>(time.count()));
        auto content = ise::encode(packet);
        body.append(ise::bytes_view(content));
        say(ise::wire::frame_type::request, id, body.view());
    }

    /// One with a number that outlives the session.
    template <class Packet>
    void numbered_request(std::uint64_t id, std::uint32_t service, std::uint64_t number, const Packet& packet,
                          std::uint8_t flags = 0) {
        ise::buffer body;
        body.append(service);
        body.append(std::int64_t{3'600'000'000'000});
        body.append(number);
        auto content = ise::encode(packet);
        body.append(ise::bytes_view(content));
        say(ise::wire::frame_type::request, id, body.view(),
            static_cast<std::uint8_t>(flags | ise::wire::flag::numbered));
    }

    /// Lets the world run until all was taken, or the provider has closed.
    void finish() {
        all_.run_until([&] {
            push();
            return unsent_.empty() || broken_;
        });
    }
    bool closed() const { return broken_ || ended; }
    void close() { line_->close(); }
    std::size_t count(ise::wire::frame_type type) const {
        return static_cast<std::size_t>(
            std::ranges::count_if(got, [&](const came& frame) { return frame.header.type == type; }));
    }
    const came* last(ise::wire::frame_type type) const {
        for (auto at = got.rbegin(); at != got.rend(); ++at)
            if (at->header.type == type) return &*at;
        return nullptr;
    }
    /// What the last refusal of that type says, an error's or a farewell's; an empty message where none came.
    ise::failure why(ise::wire::frame_type type) const {
        auto frame = last(type);
        auto as_failure = [](const auto& result) {
            return ise::failure(static_cast<ise::errc>(result.code), result.reason);
        };
        if (!frame) return {ise::errc::not_connected, ""};
        if (type == ise::wire::frame_type::error) return as_failure(ise::decode<ise::wire::call_failure>(frame->body));
        if (type == ise::wire::frame_type::ended) return as_failure(ise::decode<ise::wire::ended>(frame->body));
        return as_failure(ise::decode<ise::wire::farewell>(frame->body));
    }

    std::vector<came> got;
    bool ended = false; ///< the provider closed

private:
    void begin(bool reads) {
        auto& on = host_->loop();
        auto* datagrams = dynamic_cast<ise::net::datagram_stream*>(line_.get());
        if (datagrams && reads) {
            ise::loop::turn in(on);
            line_->deliver_to(*inbox_);
            datagrams->use(std::shared_ptr<inbox>(inbox_));
        }
        if (datagrams) reading_ = start(on, wait_for_end(*this));
        else if (reads) reading_ = start(on, read(*this));
    }
    void push() {
        while (!unsent_.empty() && !broken_) {
            asio::const_buffer raw(unsent_.data() + sent_, unsent_.size() - sent_);
            auto wrote = line_->try_write(std::span(&raw, 1));
            sent_ += wrote.bytes;
            broken_ = wrote.problem && wrote.problem != asio::error::would_block;
            if (sent_ == unsent_.size()) unsent_.clear(), sent_ = 0;
            if (wrote.problem) return;
        }
    }
    // What comes over a channel.
    struct inbox final : ise::net::datagram_stream::user, ise::stream_reader {
        explicit inbox(raw_peer& to) : self(to) {}
        void on_heard() override {}
        asio::mutable_buffer room() noexcept override {
            auto room = self.parser_.prepare();
            return asio::buffer(room.data(), room.size());
        }
        void on_bytes(const ise::transfer& read) override { self.take(read.bytes); }
        void on_message(ise::bytes_view message) override {
            auto body = message.subspan(ise::wire::frame_header::size);
            self.got.push_back({ise::wire::read_header(message.data()), ise::bytes(body.begin(), body.end())});
        }
        void on_sign() override {}
        void on_room() override {}
        raw_peer& self;
    };
    void take(std::size_t count) {
        parser_.commit(count);
        for (;;) {
            auto found = parser_.next();
            if (!found || !*found) break;
            got.push_back({(*found)->header, ise::bytes((*found)->body.begin(), (*found)->body.end())});
        }
    }
    static ise::task<> read(raw_peer& self) {
        for (;;) {
            auto room = self.parser_.prepare();
            auto moved = co_await self.line_->read_some(asio::buffer(room.data(), room.size()));
            if (moved.problem) break;
            self.take(moved.bytes);
        }
        self.ended = true;
    }
    // Without room nothing is taken; what comes is handed over, or stays where it is.
    static ise::task<> wait_for_end(raw_peer& self) {
        for (;;) {
            auto moved = co_await self.line_->read_some(asio::mutable_buffer());
            if (moved.problem) break;
        }
        self.ended = true;
    }

    sim_parties& all_;
    std::unique_ptr<ise::loop_host> host_;
    std::unique_ptr<ise::stream> line_;
    ise::wire::parser parser_{ise::wire::min_frame_limit};
    std::shared_ptr<inbox> inbox_ = std::make_shared<inbox>(*this);
    std::shared_ptr<started<void>> reading_;
    ise::bytes unsent_;
    std::size_t sent_ = 0;
    bool broken_ = false;
};

} // namespace ise_test
