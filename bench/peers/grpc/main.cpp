// gRPC: unary calls, by callback with many outstanding; a server's stream for publications.
#include "peers/peer.hpp"

#include "work.grpc.pb.h"

#include <grpcpp/grpcpp.h>

#include <atomic>
#include <stdexcept>
#include <thread>
#include <vector>

namespace {

using namespace bench;

class server final : public work::Server::Service {
public:
    explicit server(const options& asked) : asked_(asked) {}

    grpc::Status Echo(grpc::ServerContext*, const work::Packet* request, work::Packet* reply) override {
        reply->set_content(request->content());
        return grpc::Status::OK;
    }
    grpc::Status Subscribe(grpc::ServerContext*, const work::Packet*, grpc::ServerWriter<work::Packet>* out) override {
        work::Packet packet;
        packet.set_content(std::string(asked_.size_bytes, 'x'));
        if (asked_.work == "paced") {
            once_a_millisecond(packet.content(), [&](const std::string& stamped) {
                packet.set_content(stamped);
                return out->Write(packet);
            });
        } else {
            while (out->Write(packet)) continue; // with set_buffer_hint() nothing arrived in half a second
        }
        return grpc::Status::OK;
    }

private:
    options asked_;
};

void serve(const options& asked) {
    expect(asked, "grpc", {"tcp"});
    server made(asked);
    int port = 0;
    grpc::ServerBuilder builder;
    builder.SetMaxReceiveMessageSize(-1);
    builder.AddListeningPort("127.0.0.1:0", grpc::InsecureServerCredentials(), &port);
    builder.RegisterService(&made);
    auto running = builder.BuildAndStart();
    if (!running) throw std::runtime_error("it does not listen");
    announce("127.0.0.1:" + std::to_string(port));
    running->Wait();
}

std::unique_ptr<work::Server::Stub> connect(const options& asked, int number) {
    grpc::ChannelArguments how;
    how.SetMaxReceiveMessageSize(-1);
    how.SetInt("grpc.channel_id", number); // a connection each
    how.SetInt(GRPC_ARG_USE_LOCAL_SUBCHANNEL_POOL, 1);
    return work::Server::NewStub(grpc::CreateCustomChannel(asked.connect, grpc::InsecureChannelCredentials(), how));
}

struct unary {
    grpc::ClientContext context;
    work::Packet reply;
};

void call_again(work::Server::Stub& stub, const work::Packet& request, std::atomic<std::uint64_t>& answered) {
    auto* one = new unary;
    stub.async()->Echo(&one->context, &request, &one->reply, [&stub, &request, &answered, one](grpc::Status status) {
        if (status.ok()) answered.fetch_add(1, std::memory_order_relaxed);
        delete one;
        call_again(stub, request, answered);
    });
}

outcome measure(const options& asked) {
    expect(asked, "grpc", {"tcp"});
    work::Packet request;
    request.set_content(std::string(asked.size_bytes, 'x'));
    std::atomic<std::uint64_t> counted{0};
    auto stub = connect(asked, 0);
    if (asked.work == "call" && asked.outstanding == 1) {
        return one_by_one(asked, [&] {
            unary one;
            auto status = stub->Echo(&one.context, request, &one.reply);
            if (!status.ok()) throw std::runtime_error(status.error_message());
        });
    }
    if (asked.work == "call") {
        for (std::size_t i = 0; i != asked.outstanding; ++i) call_again(*stub, request, counted);
        auto out = rate_of(asked, [&] { return counted.load(); });
        print(asked, out);
        std::fflush(stdout);
        std::_Exit(0); // the calls go on
    }
    pace times(asked);
    for (std::size_t i = 0; i != asked.subscribers; ++i) {
        std::thread([&, own = std::shared_ptr(connect(asked, static_cast<int>(i + 1)))] {
            grpc::ClientContext context;
            work::Packet packet;
            auto in = own->Subscribe(&context, request);
            while (in->Read(&packet)) {
                counted.fetch_add(1, std::memory_order_relaxed);
                if (asked.work == "paced") times.take(packet.content().data());
            }
        }).detach();
    }
    auto out = rate_of(asked, [&] { return counted.load(); });
    if (asked.work == "paced") out = times.result();
    print(asked, out);
    std::fflush(stdout);
    std::_Exit(out.count == 0 ? 1 : 0); // the streams go on
}

} // namespace

int main(int argc, char** argv) { return peer_main(argc, argv, "grpc", serve, measure); }
