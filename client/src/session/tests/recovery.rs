//! What is lost is noticed, asked for and recovered from.

use super::*;

#[test]
fn a_stalled_network_is_waited_for_and_then_caught_up_with() {
    let mut client = Client::welcomed();
    let mut server = Server::default();
    client.frame(server.frame());
    let outputs = client.pass(10_000);
    assert!(
        outputs.is_empty(),
        "silence is the transport's affair: {outputs:?}"
    );

    // What was sent meanwhile arrives at once: more than the session keeps.
    let mut outputs = Vec::new();
    for _ in 0..900 {
        let (update, picture) = server.frame();
        outputs.extend(client.message(update));
        outputs.extend(client.message(picture));
    }
    assert_eq!(reset_requests(&outputs), [ResetReason::Gap]);
    assert!(presented(&outputs).is_empty());
    let outputs = client.decode_all(outputs);
    assert!(
        presented(&outputs).is_empty(),
        "pictures of a chain that was given up"
    );
    server.reset();
    assert_eq!(presented(&client.frame(server.frame())), [901]);
}

#[test]
fn a_lost_picture_is_noticed_asked_for_and_recovered_from() {
    let mut client = Client::welcomed();
    let mut server = Server::default();
    client.frame(server.frame());
    let (update, _lost) = server.frame();
    client.message(update);
    let mut outputs = client.frame(server.frame());
    outputs.extend(client.pass(240));
    assert!(reset_requests(&outputs).is_empty());
    let outputs = client.pass(20);
    assert_eq!(reset_requests(&outputs), [ResetReason::Gap]);
    // Asked again ever more rarely while the server is silent.
    assert_eq!(reset_requests(&client.pass(590)).len(), 0);
    assert_eq!(reset_requests(&client.pass(5_000)).len(), 3);

    // The rest of the broken epoch is of no use.
    assert!(presented(&client.frame(server.frame())).is_empty());
    server.reset();
    assert_eq!(presented(&client.frame(server.frame())), [4]);
    assert_eq!(presented(&client.frame(server.frame())), [5]);
}

#[test]
fn a_decoder_that_says_nothing_is_given_up_and_started_anew() {
    let mut client = Client::welcomed();
    let mut server = Server::default();
    client.frame(server.frame());
    let (update, picture) = server.frame();
    client.message(update);
    let outputs = client.message(picture);
    assert!(matches!(&outputs[..], [Output::Decode(_)]));
    assert!(reset_requests(&client.pass(1_000)).is_empty());
    assert_eq!(reset_requests(&client.pass(20)), [ResetReason::Decoder]);
    server.reset();
    let (update, picture) = server.frame();
    client.message(update);
    let outputs = client.message(picture);
    assert!(matches!(&outputs[..], [Output::Decode(unit)] if unit.restart));
    assert_eq!(presented(&client.decode_all(outputs)), [2]);
}

/// Updates of frames that were given up fill the inbox, and must not be taken
/// for ones that wait in vain.
#[test]
fn a_long_wait_for_an_idr_ends_with_it() {
    let mut client = Client::welcomed();
    let mut server = Server::default();
    client.frame(server.frame());
    for _ in 0..100 {
        let (update, _lost) = server.frame();
        client.message(update);
    }
    server.reset();
    let (update, picture) = server.frame();
    let mut outputs = client.message(picture);
    outputs.extend(client.message(update));
    assert_eq!(presented(&client.decode_all(outputs)), [101]);
}

#[test]
fn a_picture_that_does_not_decode_is_recovered_from() {
    let mut client = Client::welcomed();
    let mut server = Server::default();
    client.frame(server.frame());
    let (update, picture) = server.frame();
    client.message(update);
    let outputs = client.message(picture);
    let [Output::Decode(unit)] = &outputs[..] else {
        panic!("one picture is decoded: {outputs:?}");
    };
    let refused = Decoded {
        ticket: unit.ticket,
        picture: Err(DecodeError::NoPicture),
    };
    let outputs = client.input(Input::Decoded(refused));
    assert_eq!(reset_requests(&outputs), [ResetReason::Decoder]);
    server.reset();
    let outputs = client.frame(server.frame());
    assert!(
        outputs
            .iter()
            .any(|o| matches!(o, Output::Decode(unit) if unit.restart))
    );
    assert_eq!(presented(&outputs), [2]);
}

#[test]
fn an_epoch_that_does_not_begin_with_an_idr_or_goes_back_asks_for_a_reset() {
    let changes: [fn(&mut ToClient, &mut ToClient); 4] = [
        // The update is of another epoch than the picture.
        |update, _| epoch_of(update, 7),
        |_, picture| epoch_of(picture, 7),
        // A new epoch without an IDR picture.
        |update, picture| {
            epoch_of(update, 7);
            epoch_of(picture, 7);
        },
        // An older epoch.
        |update, picture| {
            epoch_of(update, 0);
            epoch_of(picture, 0);
        },
    ];
    for change in changes {
        let mut client = Client::welcomed();
        let mut server = Server::default();
        server.reset();
        client.frame(server.frame());
        let (mut update, mut picture) = server.frame();
        change(&mut update, &mut picture);
        let outputs = client.frame((update, picture));
        assert_eq!(reset_requests(&outputs), [ResetReason::Gap]);
        assert!(presented(&outputs).is_empty());
        server.reset();
        assert_eq!(presented(&client.frame(server.frame())), [2]);
    }
}

fn epoch_of(message: &mut ToClient, epoch: u32) {
    match message {
        ToClient::Update(update) => update.epoch.0 = epoch,
        ToClient::Picture(picture) => picture.epoch.0 = epoch,
        _ => {}
    }
}

/// Plays resets to a client for which no decoder can be had, until `most` of them.
fn without_decoder(client: &mut Client, server: &mut Server, most: u32) -> Vec<Output> {
    let mut outputs = Vec::new();
    for _ in 0..most {
        server.reset();
        let (update, picture) = server.frame();
        client.message(update);
        let asked = client.message(picture);
        let [Output::Decode(unit)] = &asked[..] else {
            panic!("one picture is decoded: {asked:?}");
        };
        outputs = client.input(Input::Decoded(Decoded {
            ticket: unit.ticket,
            picture: Err(DecodeError::Unavailable(
                "this device has none for H.264".into(),
            )),
        }));
        // Long enough for the next request.
        client.pass(3_000);
    }
    outputs
}

#[test]
fn a_decoder_that_cannot_be_had_is_asked_for_a_few_times_and_then_it_is_over() {
    let mut client = Client::welcomed();
    let mut server = Server::default();
    assert_eq!(
        failure(&without_decoder(&mut client, &mut server, 4)),
        None,
        "another application may give its own back"
    );
    server.reset();
    let shown = server.frames();
    assert_eq!(presented(&client.frame(server.frame())), [shown]);

    // From the start, since one was had meanwhile.
    let outputs = without_decoder(&mut client, &mut server, 5);
    let said = failure(&outputs).expect("it is over").to_string();
    assert_eq!(said, "no video decoder: this device has none for H.264");
    assert!(disconnected(&outputs).is_some());
    assert!(client.pass(10_000).is_empty());
}
