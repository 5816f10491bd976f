#pragma once
#include <ise/packet/codec.hpp>
#include <ise/wire/datagram.hpp>
#include <ise/wire/frame.hpp>
#include <ise/wire/messages.hpp>
#include <support/sim_parties.hpp>

#include <cstring>
#include <functional>

namespace ise_test {

/// A socket of the virtual world that says what it likes to one listener, a datagram at a time, and keeps what comes
/// back.
class raw_datagrams {
public:
    struct came {
        ise::wire::datagram_type type{};
        std::uint64_t id = 0;
        ise::bytes body;
        std::size_t size = 0; ///< of the whole datagram
    };

    raw_datagrams(sim_parties& all, ise::sim::process& from, const std::string& to)
        : all_(all), host_(from.make_loop("raw datagrams")), target_(ise::endpoint::parse(to).value()),
          socket_(
              std::move(from.open_datagram(host_->loop(), ise::endpoint::parse("udp://0.0.0.0:0").value()).value())),
          reading_(start(host_->loop(), read(*this))) {}
    ~raw_datagrams() {
        socket_->close();
        all_.run_until([&] { return reading_->done; });
    }
    raw_datagrams(const raw_datagrams&) = delete;
    raw_datagrams& operator=(const raw_datagrams&) = delete;

    void say(ise::bytes_view raw) { say_to(target_, raw); }
    void say_to(const ise::endpoint& whom, ise::bytes_view raw) {
        said += raw.size();
        socket_->try_send(whom, raw);
    }
    void say(ise::wire::datagram_type type, std::uint64_t id, ise::bytes_view body = {}) {
        ise::buffer out;
        ise::wire::put_datagram(out, type, id, body);
        say(out.view());
    }
    void open(std::uint64_t id, const ise::wire::cookie& shown = {}) {
        ise::buffer out;
        ise::wire::put_opening(out, id, shown);
        say(out.view());
    }
    /// The cookie that it was given for this id; the world runs meanwhile.
    ise::wire::cookie cookie_for(std::uint64_t id) {
        open(id);
        ise::wire::cookie given{};
        auto answer = wait_for(ise::wire::datagram_type::cookie, id);
        std::memcpy(given.data(), answer.data(), given.size());
        return given;
    }
    /// Opens a channel in good order; how its other end is addressed.
    std::uint64_t open_channel(std::uint64_t id) {
        open(id, cookie_for(id));
        return ise::detail::load_little<std::uint64_t>(wait_for(ise::wire::datagram_type::opened, id).data());
    }
    /// A datagram of a channel, with whatever chunks.
    void data(std::uint64_t to, std::uint64_t number, const std::function<void(ise::wire::data_writer&)>& chunks) {
        ise::buffer out;
        ise::wire::data_writer writer(out, to, number);
        chunks(writer);
        writer.finish();
        say(out.view());
    }

    ise::endpoint where() const { return socket_->where(); }
    std::size_t count(ise::wire::datagram_type type) const {
        return static_cast<std::size_t>(std::ranges::count_if(got, [&](const came& one) { return one.type == type; }));
    }
    std::size_t longest() const {
        std::size_t most = 0;
        for (const auto& one : got) most = std::max(most, one.size);
        return most;
    }
    std::size_t heard() const {
        std::size_t all = 0;
        for (const auto& one : got) all += one.size;
        return all;
    }

    std::vector<came> got;
    std::size_t said = 0; ///< bytes

private:
    ise::bytes wait_for(ise::wire::datagram_type type, std::uint64_t id) {
        const came* found = nullptr;
        auto there = [&] {
            for (const auto& one : got)
                if (one.type == type && one.id == id) found = &one;
            return found != nullptr;
        };
        if (!all_.run_until(there)) throw std::logic_error("no answer to an opening");
        return found->body;
    }
    static ise::task<> read(raw_datagrams& self) {
        for (;;) {
            auto datagram = co_await self.socket_->receive();
            if (datagram.first) co_return;
            const auto& content = datagram.second->content;
            if (auto seen = ise::wire::read_datagram(content))
                self.got.push_back(
                    {seen->type, seen->id, ise::bytes(seen->body.begin(), seen->body.end()), content.size()});
        }
    }

    sim_parties& all_;
    std::unique_ptr<ise::loop_host> host_;
    ise::endpoint target_;
    std::unique_ptr<ise::datagram_socket> socket_;
    std::shared_ptr<started<void>> reading_;
};

/// A session in good order over datagrams made by hand: whatever its script says, the other end takes it for one peer.
class raw_channel {
public:
    raw_channel(sim_parties& all, ise::sim::process& from, const std::string& to, std::uint64_t id = 77)
        : wire(all, from, to), theirs(wire.open_channel(id)), all_(all) {}

    /// One more datagram of the channel.
    void data(const std::function<void(ise::wire::data_writer&)>& chunks) { wire.data(theirs, number++, chunks); }
    void put(ise::wire::chunk_type type, ise::bytes_view head, ise::bytes_view content = {}) {
        data([&](ise::wire::data_writer& to) { to.put(type, head, content); });
    }
    void put(ise::wire::chunk_type type, std::uint64_t value) {
        data([&](ise::wire::data_writer& to) { to.put(type, value); });
    }
    /// What follows of the stream; less than a datagram holds.
    void content(ise::bytes_view bytes) {
        std::array<std::byte, 8> head;
        ise::detail::store_little(head.data(), offset);
        put(ise::wire::chunk_type::content, head, bytes);
        offset += bytes.size();
    }
    void fragment(std::uint64_t message, std::uint32_t size, std::uint32_t index, ise::bytes_view bytes) {
        ise::buffer head;
        head.append(message);
        head.append(size);
        head.append(index);
        put(ise::wire::chunk_type::fragment, head.view(), bytes);
    }
    void say(ise::wire::frame_type type, std::uint64_t id, ise::bytes_view body) {
        ise::buffer out;
        ise::wire::put_frame(out, type, 0, id, [&](ise::buffer& to) { to.append(body); });
        content(out.view());
    }
    void greet(const std::string& path = "raw") {
        ise::wire::hello hello;
        hello.self.path = path;
        hello.self.incarnation = 1;
        auto body = ise::encode(hello);
        say(ise::wire::frame_type::hello, 0, body);
        all_.world.run_for(std::chrono::milliseconds(200));
    }

    /// The largest number that the other end says has come: what it did not take is not among these.
    std::uint64_t acked() const {
        for (auto at = wire.got.rbegin(); at != wire.got.rend(); ++at) {
            if (at->type != ise::wire::datagram_type::data) continue;
            ise::wire::chunk_reader chunks(ise::bytes_view(at->body).subspan(8));
            while (auto one = chunks.next())
                if (one->type == ise::wire::chunk_type::ack)
                    return ise::detail::load_little<std::uint64_t>(one->content.data());
        }
        return 0;
    }

    raw_datagrams wire;
    const std::uint64_t theirs; ///< the id by which the other end is addressed
    std::uint64_t number = 0;   ///< of the next datagram
    std::uint64_t offset = 0;   ///< of the stream

private:
    sim_parties& all_;
};

} // namespace ise_test
